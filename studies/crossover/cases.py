"""The cases of the study, and the methods that solve them."""

import shlex
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from carillon.errors import UserError
from solver.analysis.options import SolverOptions
from studies.crossover.config import SECTIONS
from studies.scaling.launch import LAUNCHER
from workflow import settings, solids
from workflow.arguments import options

(SECTION,) = SECTIONS
REFERENCE, PLAIN, CORRECTED = "slepc", "hcms", "hcms_ec"
"""Methods that the page speaks of: the one that errors are taken against, and the paper's two."""


@dataclass(frozen=True)
class Method:
    """A method of `carillon modes`."""

    label: str
    """Its name for people."""
    options: Mapping[str, Any]
    """Fields of `SolverOptions` that choose it."""


METHODS = {
    PLAIN: Method("HCMS", {"method": "hcms", "corrections": 0}),
    CORRECTED: Method("HCMS + EC", {"method": "hcms"}),
    "lanczos": Method("Block Lanczos", {"method": "lanczos"}),
    "lobpcg": Method("LOBPCG", {"method": "lobpcg"}),
    "hcms_lobpcg": Method("HCMS + LOBPCG", {"method": "hcms", "linear_solver": "amg-cg"}),
    REFERENCE: Method("SLEPc", {"method": "slepc"}),
    "arpack": Method("ARPACK", {"method": "arpack"}),
}
"""All methods by their names in the configuration."""


@dataclass(frozen=True)
class Launch:
    """How ranks are started, see `studies.crossover.config.LaunchEntry`."""

    ranks: int
    threads: int | None = None
    nodes: int = 1
    latency: float | None = None
    launcher: str | None = None

    @property
    def label(self) -> str:
        """Ranks, nodes and latency as a part of a file's name."""
        network = "" if self.latency is None else f"-{self.latency:g}s"
        return f"{self.ranks}-on-{self.nodes}{network}"

    def threads_of(self, cores: int) -> int:
        """Threads of a rank, where each node has so many cores; 0 if the ranks are too many."""
        share = cores * self.nodes // self.ranks
        return share if self.threads is None else self.threads * (self.threads <= share)

    def words(self) -> list[str]:
        """The words that start the ranks; none for a single one.

        Raises UserError if the program is not on PATH.
        """
        if self.launcher is None and self.ranks == 1:
            return []
        words = shlex.split(self.launcher or f"{LAUNCHER} -n {self.ranks}")
        program = shutil.which(words[0])
        if program is None:
            raise UserError(f"no {words[0]} on PATH; install it, or name another launcher")
        return [program, *words[1:]]


@dataclass(frozen=True)
class Case:
    """A solid at a resolution on some ranks: all that one job measures."""

    solid: str
    resolution: int
    launch: Launch

    @property
    def path(self) -> str:
        """Its result file below the folder of the study."""
        return f"cases/{self.solid}/{self.resolution}-{self.launch.label}.json"


def cases_of(config: Mapping[str, Any]) -> list[Case]:
    """All cases whose mesh exists, in the order of the configuration."""
    part = config[SECTION]
    return [
        Case(solid, resolution, Launch(**launch))
        for solid in solids.named(config, f"{SECTION}.models")
        for resolution in part["models"][solid]["resolutions"]
        for launch in part["launches"]
    ]


def case_at(config: Mapping[str, Any], path: str) -> Case:
    """The case whose result file ends with `path`."""
    return next(case for case in cases_of(config) if path.endswith(case.path))


def solid_arguments(config: Mapping[str, Any], case: Case) -> list[str]:
    """Words of `carillon modes` that describe the solid of a case."""
    part = config[SECTION]
    how = {
        "resolution": case.resolution,
        "material": part["material"],
        "components": part["models"][case.solid]["components"],
        "poisson": config["poisson"],
    }
    return [settings.mesh_of(config, case.solid, SECTION), *options(how), "--no-estimate"]


def choice_of_auto(modes: int, tolerance: float, unknowns: int) -> str | None:
    """Name of the method that `--method auto` is; None if it is none of them.

    Examples
    --------
    >>> choice_of_auto(20, 1e-6, 30)
    'hcms_ec'
    """

    def resolved(**chosen: Any) -> SolverOptions:
        return SolverOptions(modes=modes, tolerance=tolerance, **chosen).with_method(unknowns)

    auto = resolved()
    return next((name for name, each in METHODS.items() if resolved(**each.options) == auto), None)
