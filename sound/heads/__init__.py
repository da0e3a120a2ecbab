"""Measured heads: files of them (SOFA), sound from any direction at their ears, and blends."""
