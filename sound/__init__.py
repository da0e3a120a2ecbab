"""Sound design: targets from clips, material optimisation, synthesis and export."""

import carillon
