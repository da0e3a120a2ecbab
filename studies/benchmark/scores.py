"""What a row of the time table is judged by: spreads, errors and ratios whose base is named."""

from collections.abc import Mapping, Sequence
from typing import Any

from carillon.arrays import Array
from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import frequencies
from solver.verification.matching import AUDIBLE_LAST, eigenvalue_errors, frequency_errors


def spectrum_error(values: Array, exact: Array) -> dict[str, float]:
    """Median, 90th percentile and maximum relative error of the elastic eigenvalues."""
    return eigenvalue_errors(*_elastic(values, exact))


def tone_error(values: Array, exact: Array) -> dict[str, float]:
    """Relative errors of the frequencies, matched by index: of modes 7 to 60, and of all."""
    computed, true = _elastic(values, exact)
    errors = frequencies(computed) / frequencies(true) - 1.0
    audible = frequency_errors(errors, AUDIBLE_LAST)
    everything = frequency_errors(errors, RIGID_MODES + len(errors))
    return {
        "rms_7_60": audible.rms,
        "worst_7_60": audible.worst,
        "rms": everything.rms,
        "worst": everything.worst,
    }


def speedups(
    seconds: Mapping[str, float | None],
    bases: Mapping[str, Sequence[str]],
    added: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Time of a base over the time of a method, by method and base.

    Parameters
    ----------
    seconds
        Medians by method.
    bases
        Methods that a method's speed-up is told over.
    added
        What is added to a method's own time, such as its precomputation.

    Examples
    --------
    >>> bases = {"hcms_ec": ("arpack", "slepc")}
    >>> speedups({"slepc": 8.0, "arpack": None, "hcms_ec": 2.0}, bases)
    {'hcms_ec': {'slepc': 4.0}}
    """
    ratios = {}
    for method, others in bases.items():
        own = seconds.get(method)
        if own is None:
            continue
        own += (added or {}).get(method, 0.0)
        over = {base: time / own for base in others if (time := seconds.get(base)) is not None}
        if over:
            ratios[method] = over
    return ratios


def _elastic(values: Array, exact: Array) -> tuple[Array, Array]:
    count = min(len(values), len(exact))
    return values[RIGID_MODES:count], exact[RIGID_MODES:count]
