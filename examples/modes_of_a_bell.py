"""Modes of a bell: its lowest elastic mode, and the frequencies of the first thirty.

The six rigid motions of a free body come first, so that elastic modes begin with number 7.
"""

import carillon as ca

bell = ca.load_mesh("builtin:bell")
solution = ca.solve(bell, ca.Material.named("brass"), resolution=20, modes=36)
print("Hz:", *solution.frequencies[6:].round(1))
solution.plot(7).savefig("modes_of_a_bell.png", dpi=80)
