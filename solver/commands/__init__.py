"""The solver's commands."""

from carillon.commands import Command

COMMANDS = {
    "modes": Command("solver.commands.modes", "modes of a solid, in a file", ranks=True),
    "compare": Command(
        "solver.commands.compare", "errors of modes files against another", ranks=True
    ),
    "audit": Command(
        "solver.commands.audit",
        "residuals, orthogonality and inertia count anew, from modes files alone",
    ),
    "respond": Command("solver.commands.respond", "motion and sound of a strike (Fig. 12, 13)"),
    "convergence": Command(
        "solver.commands.convergence",
        "eigenvalues after each correction from several starts (Fig. 10)",
        ranks=True,
    ),
    "benchmark": Command(
        "solver.commands.benchmark", "time all methods on one solid (Fig. 11)", ranks=True
    ),
    "profile": Command(
        "solver.commands.profile", "where the time goes, beside what the machine can do"
    ),
    "scaling": Command(
        "solver.commands.scaling",
        "wall time over the number of ranks, measured and modelled",
        ranks=True,
    ),
    "objectives": Command(
        "solver.commands.objectives",
        "spectra of one solid coarsened by every fit objective, and by forests",
        ranks=True,
    ),
    "coarsening": Command(
        "solver.commands.coarsening",
        "errors of a coarse model's single modes, true and expected, and what they are due to",
    ),
    "discretisation": Command(
        "solver.commands.discretisation",
        "errors, unknowns and time of voxels, coarse elements and finite cells of one solid",
    ),
    "accuracy": Command(
        "solver.commands.accuracy",
        "errors of voxels, finite cells and tetrahedra against frequencies that no mesh made",
    ),
    "distance": Command(
        "solver.commands.distance",
        "distances from the solid that spectra expect, beside those from a much finer lattice",
    ),
    "calibrate": Command(
        "solver.commands.calibrate",
        "constants of the objective `calibrated` from spectra of random solids",
    ),
}
