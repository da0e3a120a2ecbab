"""Ranks: the same script on one process and on many, with the same spectrum.

    mpiexec -n 4 python -m mpi4py on_ranks.py

All ranks call `solve` together; frequencies are on each, shapes and files on rank 0.
"""

import carillon as ca
from mpi4py import MPI

rank, size = MPI.COMM_WORLD.rank, MPI.COMM_WORLD.size
solution = ca.solve("builtin:snare-drum", "two-region", resolution=24, modes=40)
print(f"rank {rank} of {size}: {solution.frequencies[6]:.6f} Hz is the lowest elastic mode")
solution.save("on_ranks.h5")
if rank == 0:
    solution.plot(7).savefig("on_ranks.png", dpi=70)
