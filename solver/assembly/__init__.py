"""Stiffness and mass of the whole solid, distributed by rows."""
