"""Sounds of strikes: a bank of damped modes, and the noise of the clips."""
