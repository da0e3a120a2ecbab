"""Modes for ParaView: all shapes of a solid in one VTU file, with the moduli of its cells.

The picture is what ParaView shows with "Warp By Vector" of one of them.
"""

import carillon as ca

fork = ca.solve("builtin:fork", ca.Material.named("steel"), resolution=40, modes=16)
fork.to_vtu("fork.vtu")
fork.plot(8).savefig("modes_for_paraview.png", dpi=80)
