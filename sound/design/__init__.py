"""Optimisation of the material until struck points sound as their clips (sections 5 and 6)."""
