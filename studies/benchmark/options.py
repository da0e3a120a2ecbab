"""How a row of the time table is measured."""

from typing import Annotated

from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import NumberOfModes, Positive, between
from studies.benchmark.further_rivals import ALL, RIVALS
from studies.benchmark.methods import RIVAL_SECONDS
from studies.benchmark.table import METHODS

Rounds = Annotated[int, between(1, 10_000)]
"""A number of rounds."""


@parameters
class BenchmarkOptions:
    """How a row is measured."""

    modes: NumberOfModes = option(256, "number of modes, rigid ones included")
    runs: Rounds = option(5, "rounds; in each, every method runs once")
    slow_runs: Rounds | None = option(
        None,
        "rounds that ARPACK and --rivals take part in (default: all)",
    )
    fine_runs: Rounds | None = option(
        None,
        "rounds that methods on the fine mesh take part in (default: all)",
    )
    design: bool = option(
        False, "only what a design does on the coarse mesh, and --method auto and SLEPc beside it"
    )
    arpack: bool = option(True, "run ARPACK, the slowest method, too")
    arpack_regular: bool = option(False, "also ARPACK without a factorisation, on a lumped mass")
    rough: bool = option(False, "also the fine mesh to 1e-3, from random vectors and coarse modes")
    rivals: tuple[Annotated[str, OneOf(*RIVALS, ALL)], ...] | None = option(
        None, "further general eigensolvers, on one rank"
    )
    rival_seconds: Positive = option(
        RIVAL_SECONDS, "wall time after which one of these is given up [s]"
    )
    tune: bool = option(
        False, "SLEPc in its fastest configuration of several, each tried once before"
    )

    @property
    def left_out(self) -> tuple[str, ...]:
        """Methods that the options leave out."""
        asked = {**dict.fromkeys(RIVALS, False), **dict.fromkeys(self.further, True), **vars(self)}
        return tuple(
            name
            for name, method in METHODS.items()
            if not asked.get(method.option or "", True) or (self.design and not method.design)
        )

    @property
    def further(self) -> tuple[str, ...]:
        """Further rivals that the options ask for."""
        asked = self.rivals or ()
        return tuple(name for name in RIVALS if name in asked or ALL in asked)

    def rounds(self, name: str) -> int:
        """Runs of a method."""
        limits = [self.runs]
        if METHODS[name].slow and self.slow_runs is not None:
            limits.append(self.slow_runs)
        if not METHODS[name].coarse and self.fine_runs is not None:
            limits.append(self.fine_runs)
        return min(limits)
