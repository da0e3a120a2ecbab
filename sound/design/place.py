"""The place where a design is heard: the transfer to it, of a search and of a finished design."""

from dataclasses import replace

import numpy as np

from carillon.arrays import Array, Integers
from carillon.fem.model import Solid, mass_properties
from sound.project.design import Design
from sound.radiation.far_place import FarPlace
from sound.radiation.place import transfer_to
from sound.radiation.transfer import Transfer
from sound.shape import Shape


def place_transfer(
    place: FarPlace,
    model: Solid,
    surface: tuple[Array, Integers],
    hertz: Array,
    name: str,
) -> Transfer:
    """Transfer to a place from a solid with a surface of vertices (V, 3) [m] and faces (F, 3).

    It is for frequencies (N,) [Hz]; `sound.radiation.place.transfer_to` has the errors.
    """
    centre = mass_properties(model).centre
    shape = Shape.of_surface(*surface, centre)
    return transfer_to(place, shape, centre, (float(hertz.min()), float(hertz.max())), name)


def with_pressures(design: Design, transfer: Transfer | None) -> Design:
    """The design with the pressures of its modes at its place.

    The `transfer` is that of its search, None if its amplitudes are those of the struck points; it
    is found again where the design's frequencies are beyond its band.
    """
    if transfer is None:
        return design
    if not transfer.covers(design.frequencies):
        transfer = transfer_of(design)
    heard = transfer.heard(design.model, design.elastic_modes, design.frequencies)
    return replace(design, heard=heard)


def transfer_of(design: Design) -> Transfer:
    """Transfer to the place where a design is heard, for its frequencies.

    Raises UserError if boundary elements are asked for and not installed.
    """
    place = design.place
    assert place is not None
    surface = design.surface_vertices, design.surface_faces
    hertz = np.concatenate([design.frequencies, design.targets.frequencies])
    return place_transfer(place, design.model, surface, hertz, design.name)
