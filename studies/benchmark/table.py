"""The methods of the time table, each declared once."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from solver.correction.criteria import INTERACTIVE_TOLERANCE
from studies.benchmark.further_rivals import RIVALS
from studies.benchmark.methods import (
    CORRECTED_TOLERANCE,
    ROUGH_TOLERANCE,
    MethodRun,
    Methods,
)


@dataclass(frozen=True)
class TimedMethod:
    """A row of the time table."""

    run: Callable[[Methods], MethodRun]
    """Makes one run."""
    meaning: str = ""
    """What it is, where its name does not say so."""
    reference: str | None = None
    """Spectrum of SLEPc that it approximates: `fine`, `coarse` or `coarse_changed`."""
    over: tuple[str, ...] = ()
    """Methods that its speed-up is told over."""
    coarse: bool = False
    """Whether it is on the coarse mesh."""
    needs: str | None = None
    """`forests` or `voxels`, without which it is left out."""
    option: str | None = None
    """Option that asks for it."""
    design: bool = True
    """Whether it is run beside what a design does."""
    slow: bool = False
    """Whether it takes part in the slow rounds alone."""
    problem: str = ""
    """What it solves, where that is another problem than its name says."""


_LUMPED_MASS = (
    "fine mesh with a row-sum lumped mass, which {} needs to do without any factorisation; its "
    "spectrum is another than that of the consistent mass"
)
_on_fine = partial(TimedMethod, reference="fine")
_on_coarse = partial(TimedMethod, coarse=True, needs="forests")
_GENERAL = ("arpack", "slepc")


def _further(name: str) -> TimedMethod:
    rival = RIVALS[name]
    return TimedMethod(
        lambda methods: methods.further(name),
        rival.meaning,
        None if rival.lumped else "fine",
        needs="voxels" if rival.lumped else None,
        option=name,
        slow=True,
        problem=_LUMPED_MASS.format("a filter") if rival.lumped else "",
    )


METHODS = {
    "arpack": _on_fine(
        lambda methods: methods.general("arpack"), option="arpack", design=False, slow=True
    ),
    "slepc": TimedMethod(lambda methods: methods.general("slepc")),
    "ddfem": _on_coarse(
        lambda methods: methods.general("slepc", "ddfem"),
        "coarsened by forests, then SLEPc on the coarse model (DDFEM* alone)",
        over=_GENERAL,
    ),
    "ddfem_rough": _on_coarse(
        lambda methods: methods.general("slepc", "ddfem", INTERACTIVE_TOLERANCE),
        "the same to a residual of 1e-2",
        "coarse",
        over=_GENERAL,
    ),
    "hcms": _on_fine(
        lambda methods: methods.solve(method="hcms", corrections=0),
        over=_GENERAL,
        design=False,
    ),
    "hcms_ec": _on_fine(
        lambda methods: methods.solve(method="hcms", tolerance=CORRECTED_TOLERANCE),
        over=_GENERAL,
        design=False,
    ),
    "fastest": _on_fine(
        lambda methods: methods.solve(tolerance=CORRECTED_TOLERANCE),
        "what --method auto takes: block Lanczos from random vectors",
        over=(*_GENERAL, "hcms_ec"),
    ),
    "slepc_rough": _on_fine(
        lambda methods: methods.general("slepc", tolerance=ROUGH_TOLERANCE),
        "SLEPc to a residual of 1e-3",
        option="rough",
    ),
    "fastest_rough": _on_fine(
        lambda methods: methods.solve(tolerance=ROUGH_TOLERANCE),
        "the fastest to an eigenvalue error of 1e-3",
        over=("slepc_rough",),
        option="rough",
    ),
    "refined": _on_fine(
        lambda methods: methods.solve(from_coarse=True, tolerance=ROUGH_TOLERANCE),
        "the same from the modes of the solid coarsened by forests, which is solved before",
        over=("slepc_rough", "fastest_rough"),
        needs="forests",
        option="rough",
    ),
    "ddfem_ec_accurate": _on_coarse(
        lambda methods: methods.solve("ddfem", tolerance=CORRECTED_TOLERANCE),
        "coarsened by forests, then the fastest to the same accuracy as on the fine mesh",
        "coarse",
        over=(*_GENERAL, "ddfem"),
    ),
    "ddfem_ec": _on_coarse(
        lambda methods: methods.solve("ddfem", tolerance=INTERACTIVE_TOLERANCE),
        "coarsened by forests, then the fastest to the interactive tolerance, from nothing",
        "coarse",
        over=(*_GENERAL, "ddfem", "ddfem_rough", "fastest"),
    ),
    "ddfem_ec_warm": _on_coarse(
        Methods.solve_warm,
        "the same for moduli that differ by a smooth field of 5 %, starting from the modes of the "
        "unchanged ones",
        "coarse_changed",
        over=(*_GENERAL, "ddfem", "ddfem_rough", "ddfem_ec"),
    ),
    "arpack_regular": TimedMethod(
        Methods.arpack_regular,
        needs="voxels",
        option="arpack_regular",
        slow=True,
        problem=_LUMPED_MASS.format("ARPACK"),
    ),
    **{name: _further(name) for name in RIVALS},
}
"""Methods in the order in which they run."""
