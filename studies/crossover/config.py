"""Keys of the study in the configuration, and what its jobs take."""

from dataclasses import KW_ONLY
from typing import Annotated

from annotated_types import Ge, Le

from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.quantities import Tolerance
from carillon.parameters.sentences import ParameterError
from studies.crossover.methods import METHODS
from workflow.configuration.resources import JobLimits
from workflow.configuration.run import Configuration
from workflow.configuration.section import (
    CommandLine,
    Distinct,
    File,
    Ranks,
    Runs,
    Seconds,
    Several,
    Title,
)
from workflow.configuration.solids import (
    Material,
    ModelModes,
    Solids,
    StudiedSolid,
    default_solids,
)

MethodName = Annotated[str, OneOf(*METHODS)]
SECTION = "crossover"


@parameters
class Launch:
    """How the ranks of a run are started, and on what network."""

    _: KW_ONLY
    ranks: Ranks = option(REQUIRED, "MPI ranks [1]")
    threads: Annotated[int, Ge(1), Le(4096)] | None = option(
        None, "threads of each rank; its share of the cores if null [1]"
    )
    nodes: Annotated[int, Ge(1), Le(4096)] = option(1, "machines that the ranks are on [1]")
    latency: Annotated[float, Ge(0), Le(1)] | None = option(
        None, "latency of the network between the nodes, a label of the results [s]"
    )
    launcher: CommandLine | None = option(
        None, "what starts the ranks, such as srun --mpi=pmix -N3 -n3; mpiexec -n RANKS if null"
    )

    @property
    def label(self) -> str:
        """Ranks, nodes and latency as a part of a file's name."""
        network = "" if self.latency is None else f"-{self.latency:g}s"
        return f"{self.ranks}-on-{self.nodes}{network}"

    def threads_of(self, cores: int) -> int:
        """Threads of a rank, where each node has so many cores; 0 if the ranks are too many."""
        share = cores * self.nodes // self.ranks
        return share if self.threads is None else self.threads * (self.threads <= share)


@parameters
class CrossoverSection:
    """The study that tells the fastest method by unknowns, modes, ranks and tolerance; target
    crossover computes it.
    """

    models: Solids[StudiedSolid] = option(
        default_solids(StudiedSolid, {"bell": {"resolutions": [12, 24, 36]}})
    )
    material: Material = option("smooth", "named material of every solid")
    modes: Several[ModelModes] = option((64, 256), "numbers of modes, each computed [1]")
    tolerances: Several[Tolerance] = option(
        (1e-2, 1e-6), "relative eigenvalue errors that methods are asked for, each [1]"
    )
    methods: Several[MethodName] = option(tuple(METHODS), "names of the methods")
    launches: Several[Launch] = option(
        (Launch(ranks=1), Launch(ranks=2)), "ranks, nodes and networks, each measured"
    )
    seconds: Seconds = option(60.0, "wall time after which a run is ended [s]")
    runs: Runs = option(
        1, "runs of which the fastest counts; what takes a tenth of the limit runs once [1]"
    )
    most_unknowns: dict[str, Annotated[int, Ge(1), Le(2**31)]] = option(
        dict, "largest number of unknowns that a method is run on, by its name [1]"
    )
    machine: Title = option("", "name of the machine on the page; its processor if empty")
    joined: Distinct[File] = option(
        (), "files runs.csv of this study from other machines, which are shown on the same page"
    )

    def check_in(self, run: Configuration) -> None:
        """Check that limits are those of methods, and launches can be told apart."""
        for name in self.most_unknowns:
            if name not in METHODS:
                known = ", ".join(METHODS)
                raise ParameterError(
                    ("most_unknowns",), f"{name!r} is no method, expected one of {known}"
                )
        if len({launch.label for launch in self.launches}) < len(self.launches):
            raise ParameterError(
                ("launches",), "two have the same ranks, nodes and latency, expected others"
            )


SECTIONS = {SECTION: CrossoverSection}
LIMITS = {
    "measure_crossover": JobLimits(
        "a solid of the crossover, by all methods on some ranks", 8000, 240
    )
}
