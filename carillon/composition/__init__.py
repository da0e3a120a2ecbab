"""Regions of a solid with their materials and places, and its supports."""
