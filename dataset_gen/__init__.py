"""Training set of the data-driven coarsening: hexahedron, 2x2x2 block, fits, shards."""

import carillon
