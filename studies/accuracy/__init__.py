"""The study of discretisations against frequencies that no mesh made."""

from carillon.command_line.commands import Command

COMMANDS = {
    "accuracy": Command(
        "studies.accuracy.command",
        "errors of voxels, finite cells and tetrahedra against frequencies that no mesh made",
        room="solver",
    ),
    "materials": Command(
        "studies.accuracy.materials_command",
        "errors of solids of several materials, of wood, and held ones against theories",
        room="solver",
    ),
    "distance": Command(
        "studies.accuracy.distance_command",
        "distances from the solid that spectra expect, beside those from a much finer lattice",
        room="solver",
    ),
}
