"""Modal analysis of voxel solids, from the mesh file to the modes file."""

import carillon
