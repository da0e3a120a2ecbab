"""Constants of air at 20 C."""

AIR_DENSITY = 1.204
"""Density [kg/m^3]."""
SOUND_SPEED = 343.2
"""Speed of sound [m/s]."""
