"""Modes and matrices in the files of other programs."""
