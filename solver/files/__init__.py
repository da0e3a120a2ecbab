"""Modes in files, and solutions that start from them."""
