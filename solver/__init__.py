"""Modal analysis of voxel solids, from the mesh file to the modes file."""

from typing import TYPE_CHECKING

from carillon import lazy_exports

if TYPE_CHECKING:
    from solver.analysis.library import Solution, solve
    from solver.analysis.modal_solver import ModalSolver
    from solver.analysis.modes import Modes
    from solver.analysis.options import SolverOptions

__all__ = ["ModalSolver", "Modes", "Solution", "SolverOptions", "solve"]

__getattr__ = lazy_exports.exports(
    __name__,
    {
        "Solution": "analysis.library",
        "solve": "analysis.library",
        "ModalSolver": "analysis.modal_solver",
        "Modes": "analysis.modes",
        "SolverOptions": "analysis.options",
    },
)
