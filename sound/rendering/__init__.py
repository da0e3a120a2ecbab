"""Sounds of strikes: damped modes, and the noise of the clips."""
