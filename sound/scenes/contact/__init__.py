"""Rigid bodies in motion, and the contacts between them."""
