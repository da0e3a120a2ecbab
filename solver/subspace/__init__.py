"""Bases of vectors: orthonormal, by Rayleigh-Ritz, and how good their pairs are."""
