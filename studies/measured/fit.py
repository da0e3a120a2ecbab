"""Elastic constants of a measured solid from its frequencies, without a mesh."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from carillon.arrays import Array
from carillon.errors import UserError
from studies.measured.solid import Crystal, MeasuredSolid

STEP = 1e-4
"""Relative step of the differences that derivatives are taken from."""


@dataclass(frozen=True)
class ConstantsFit:
    """A solid with the constants that its frequencies ask for."""

    solid: MeasuredSolid
    errors: Array
    """(n,) relative errors that these leave, not a number where no frequency is known."""

    @property
    def rms(self) -> float:
        """Root mean square of the errors."""
        return float(np.sqrt(np.nanmean(self.errors**2)))


def fitted(solid: MeasuredSolid, fewer: int = 0) -> ConstantsFit:
    """Fit all elastic constants, and how a crystal is turned if it is, from those that it has.

    Frequencies are matched by index, and a start that is far off ends elsewhere. `fewer` lowers the
    degrees of the polynomials. Raises UserError of a solid without a solution by polynomials.
    """
    if solid.degrees is None:
        raise UserError(f"{solid.title} has no solution without a mesh (degrees)")
    names, start = _constants(solid)

    def errors(values: Array) -> Array:
        return _with(solid, names, values * start).without_a_mesh(fewer) / solid.hertz - 1.0

    known = np.isfinite(solid.hertz)
    found = least_squares(lambda values: errors(values)[known], np.ones_like(start), diff_step=STEP)
    return ConstantsFit(_with(solid, names, found.x * start), errors(found.x))


def _constants(solid: MeasuredSolid) -> tuple[list[str], Array]:
    material = solid.material
    if material.elastic is None:
        assert material.isotropic is not None
        return ["young", "poisson"], np.array(material.isotropic)
    constants = material.elastic.constants
    turn = material.elastic.turned if any(material.elastic.turned) else ()
    return list(constants), np.array([*constants.values(), *turn])


def _with(solid: MeasuredSolid, names: list[str], values: Array) -> MeasuredSolid:
    """The solid with other constants."""
    material = solid.material
    named = dict(zip(names, map(float, values)))
    if material.elastic is None:
        changed = replace(material, young=named["young"], poisson=named["poisson"])
    else:
        x, y, z = map(float, values[len(names) :]) if any(material.elastic.turned) else (0.0,) * 3
        changed = replace(material, elastic=Crystal(material.elastic.symmetry, named, (x, y, z)))
    return replace(solid, material=changed)


def as_text(fit: ConstantsFit) -> str:
    """Constants, and the errors that they leave."""
    material = fit.solid.material
    if material.elastic is None:
        assert material.isotropic is not None
        young, poisson = material.isotropic
        lines = [f"young    {young / 1e9:10.3f} GPa", f"poisson  {poisson:10.4f}"]
    else:
        constants = material.elastic.constants.items()
        lines = [f"{name:<8} {value / 1e9:10.3f} GPa" for name, value in constants]
        if any(material.elastic.turned):
            turn = ", ".join(f"{each:.3f}" for each in material.elastic.turned)
            lines.append(f"turned   {turn} degrees")
    known = int(np.isfinite(fit.errors).sum())
    worst = fit.errors[np.nanargmax(np.abs(fit.errors))]
    return "\n".join(
        [fit.solid.title, *lines, f"{known} frequencies: {fit.rms:.3%} rms, worst {worst:+.3%}"]
    )
