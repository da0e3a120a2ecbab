"""The place where a design is heard: the transfer to it, of a project and of a finished design."""

from dataclasses import replace

from carillon.fem.model import mass_properties
from sound.project.design import Design
from sound.radiation.place import transfer_to
from sound.radiation.transfer import Transfer
from sound.shape import Shape


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
    centre = mass_properties(design.model).centre
    shape = Shape.of_surface(design.surface_vertices, design.surface_faces, centre)
    hertz = [*design.frequencies, *design.targets.frequencies]
    return transfer_to(place, shape, centre, (float(min(hertz)), float(max(hertz))), design.name)
