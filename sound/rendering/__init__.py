"""Sounds of strikes: a bank of damped modes, and what of the clips is no mode."""
