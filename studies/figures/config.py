"""Keys of the study in the configuration, and what its jobs take."""

from dataclasses import KW_ONLY
from typing import Literal

from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.quantities import Resolution
from workflow.configuration.resources import JobLimits
from workflow.configuration.run import Configuration, Corrections
from workflow.configuration.section import Distinct, Line, RankCounts, Runs, Several, require_named
from workflow.configuration.solids import Material, ModelModes, SolidEntry, Solids, default_solids

SOLIDS = {
    "bunny": {"resolution": 32},
    "teapot": {"resolution": 40},
    "bell": {"resolution": 32},
    "pitcher": {"resolution": 32},
    "snare-drum": {"resolution": 32},
    "frying-pan": {"resolution": 44},
}
"""Solids that are measured by default."""
Rival = Literal[
    "scipy_superlu",
    "scipy_pardiso",
    "scipy_lobpcg",
    "primme_direct",
    "primme_multigrid",
    "slepc_lobpcg",
    "slepc_gd",
    "slepc_jd",
    "slepc_ciss",
    "slepc_filter",
    "slepc_evsl",
    "all",
]


@parameters
class FiguresSolid(SolidEntry):
    """A solid of the figures."""

    _: KW_ONLY
    resolution: Resolution = option(REQUIRED)
    material: Material = option("smooth", "named material")


@parameters
class FiguresSection:
    """Fig. 10, Fig. 11 and the scaling over ranks in full; target figures computes them."""

    models: Solids[FiguresSolid] = option(default_solids(FiguresSolid, SOLIDS))
    modes: ModelModes = option(256)
    runs: Runs = option(5, "rounds in which every method runs once [1]")
    slow_runs: Runs = option(1, "rounds that ARPACK takes part in [1]")
    tune: bool = option(True, "whether SLEPc runs in the fastest of several configurations")
    arpack_regular: bool = option(
        False, "whether ARPACK also runs without a factorisation, on a lumped mass"
    )
    rough: bool = option(
        True,
        "whether the fine mesh is also solved to 1e-3, by SLEPc, from random vectors and from "
        "coarse modes",
    )
    rivals: Distinct[Rival] = option(
        (), "further general eigensolvers that are timed, slow_runs times; some take minutes"
    )
    convergence: Several[Line] = option(("bunny", "frying-pan"), "names of the solids of Fig. 10")
    steps: Corrections = option(3, "corrections made in Fig. 10 [1]")
    scaling: Several[Line] = option(("bunny", "bell"), "names of the solids whose scaling is shown")
    ranks: RankCounts = option((1, 2, 3, 4), "numbers of ranks that the scaling is measured on [1]")
    weak: bool = option(True, "whether solids that grow with the ranks are measured too")

    def check_in(self, run: Configuration) -> None:
        """Check that convergence and scaling are of solids of the figures."""
        require_named("convergence", self.convergence, self.models)
        require_named("scaling", self.scaling, self.models)


SECTIONS = {"figures": FiguresSection}
LIMITS = {
    "follow_convergence_in_full": JobLimits(
        "history of the corrections in target figures", 16000, 120
    )
}
