"""The study of the worst single modes of coarse models, and of the errors expected of them."""

from carillon.command_line.commands import Command

COMMANDS = {
    "coarsening": Command(
        "studies.coarsening.command",
        "errors of a coarse model's single modes, true and expected, and what they are due to",
        room="solver",
    ),
    "ratios": Command(
        "studies.coarsening.ratios_command",
        "errors of coarse models by Poisson's ratio: forests, fits at each ratio, Galerkin",
        room="solver",
    ),
}
