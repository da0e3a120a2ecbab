"""Frequencies of both discretisations and of tetrahedra against those that no mesh made."""
