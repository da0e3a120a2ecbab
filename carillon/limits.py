"""How large and how small the solids may be that are analysed.

Far wider than anything that has been struck, and narrow enough that no product of these quantities
leaves the range of double precision, and that voxels have distinct places.
"""

from carillon.errors import UserError

EXTENTS = (1e-9, 1e9)
"""Longest side of a solid [m]."""
EDGES = (1e-16, 1e9)
"""Edge of a cell [m]."""
FARTHEST = 1e8
"""Distance of a solid from the origin, in multiples of its longest side."""
MESH_BYTES = 2 << 30
"""Length of a mesh file with those that it names; triangles take about 50 bytes each."""
UNITS = (1e-12, 1e12)
"""Metres per unit of a mesh."""
MODULI = (1e-3, 1e15)
"""Young's modulus [Pa]."""
LARGEST_CONTRAST = 1e12
"""Ratio of the moduli of one solid; beyond, rounding of the stiff cells hides the soft ones."""
DENSITIES = (1e-3, 1e6)
"""Mass density [kg/m^3]."""
RESOLUTIONS = (2, 100_000)
"""Voxels, or lattice spacings, along the longest side of a solid."""
FEWEST_MODES = 7
"""Modes that are computed of a solid, of which the first six are rigid motions."""
POISSON = (-1.0, 0.5)
"""Poisson's ratio, both ends excluded."""


def require_constants(poisson: float, density: float) -> None:
    """Check Poisson's ratio and the mass density [kg/m^3] of a solid.

    Raises UserError if one is out of range.
    """
    if not POISSON[0] < poisson < POISSON[1]:
        raise UserError(f"Poisson's ratio {poisson:g} is outside (-1, 0.5)")
    require_within(f"density {density:g} kg/m^3", density, DENSITIES)


def require_within(what: str, value: float, limits: tuple[float, float]) -> None:
    """Check that a number is within limits, both of them included.

    Raises UserError if it is not; `what` names it and its value.

    Examples
    --------
    >>> require_within("density -1 kg/m^3", -1.0, DENSITIES)
    Traceback (most recent call last):
    carillon.errors.UserError: density -1 kg/m^3: expected 0.001 to 1e+06
    """
    low, high = limits
    if not low <= value <= high:
        raise UserError(f"{what}: expected {low:g} to {high:g}")
