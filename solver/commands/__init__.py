"""The solver's commands."""

from carillon.command_line.commands import Command

COMMANDS = {
    "modes": Command("solver.commands.modes", "modes of a solid, in a file", ranks=True),
    "compare": Command(
        "solver.commands.compare", "errors of modes files against another", ranks=True
    ),
    "audit": Command(
        "solver.commands.audit",
        "residuals, orthogonality and inertia count anew, from modes files alone",
    ),
    "vtu": Command("solver.commands.vtu", "modes for ParaView, PyVista and meshio"),
    "matrices": Command("solver.commands.matrices", "stiffness and mass for other eigensolvers"),
    "respond": Command("solver.commands.respond", "motion and sound of a strike (Fig. 12, 13)"),
}
