"""Which discretisation for which material: voxels, DDFEM* and finite cells against one truth."""
