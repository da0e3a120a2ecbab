"""Designs that can be built: real materials in place of a continuous field, and their parts."""
