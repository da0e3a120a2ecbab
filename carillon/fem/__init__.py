"""The solid as finite elements: geometry, hexahedra, 2x2x2 blocks, material and model."""
