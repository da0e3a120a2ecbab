"""Transfer to the place where a design is heard, found again from the design."""

import numpy as np

from carillon.fem.model import mass_properties
from sound.project.design import Design
from sound.radiation.place import transfer_to
from sound.radiation.transfer import Transfer
from sound.shape import Shape


def transfer_of(design: Design) -> Transfer:
    """Transfer to the place where a design is heard, which it names.

    Raises UserError if boundary elements are asked for and not installed.
    """
    place = design.place
    assert place is not None
    centre = mass_properties(design.model).centre
    shape = Shape.of_surface(design.surface_vertices, design.surface_faces, centre)
    hertz = float(np.min(design.frequencies)), float(np.max(design.frequencies))
    return transfer_to(place, shape, centre, hertz, design.name)
