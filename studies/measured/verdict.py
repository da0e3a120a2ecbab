"""Whether an error is what mesh and data explain."""

AGREES, TOO_COARSE, DIFFERS = "agrees", "mesh too coarse to tell", "differs"
"""Verdicts."""


def verdict(rms: float, mesh: float, data: float) -> str:
    """Verdict on the rms error of frequencies.

    It differs if it is larger than the sum of the rms errors that are expected of the mesh and of
    the data. Where the mesh's is the larger one of these, a small error proves nothing.

    Examples
    --------
    >>> verdict(0.004, 0.001, 0.002), verdict(0.002, 0.001, 0.002), verdict(0.002, 0.01, 0.002)
    ('differs', 'agrees', 'mesh too coarse to tell')
    """
    if rms > mesh + data:
        return DIFFERS
    return TOO_COARSE if mesh > data else AGREES
