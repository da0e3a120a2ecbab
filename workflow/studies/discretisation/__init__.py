"""The study of voxels, coarse elements and finite cells by material."""
