"""Coarse elements from blocks of fine ones."""
