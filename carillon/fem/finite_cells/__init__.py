"""Finite cells of degree 4: a lattice of cells, integrated sharply over a solid's inside.

Cells of four times the lattice's spacing cover the solid, and each is integrated over the part of
it that is inside the surface (finite cell method, Parvizian, Duester and Rank 2007). So walls need
not follow the lattice, nor be as thick as its spacing. Where more is needed they are divided.
"""
