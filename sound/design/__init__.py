"""Optimisation of a material by the clips of struck points (sections 5 and 6)."""
