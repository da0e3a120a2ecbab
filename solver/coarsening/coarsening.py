"""What all coarsenings have in common."""

from abc import ABC, abstractmethod

from carillon.arrays import Array
from carillon.errors import UserError


class Coarsening(ABC):
    """A map from the fine moduli of 2x2x2 blocks to the moduli of the elements that replace them.

    Attributes
    ----------
    name
        What it is called on a command line.
    lumped_fraction
        Fraction of lumped mass in elements without void octants, see `ElasticModel`.
    general
        Objective by which blocks with anisotropic cells are fitted; None if their moduli follow
        from those of the cells as others' do.
    """

    def __init__(self, name: str, lumped_fraction: float = 0.0, general: str | None = None) -> None:
        self.name = name
        self.lumped_fraction = lumped_fraction
        self.general = general

    @abstractmethod
    def moduli(self, e: Array) -> Array:
        """Moduli (mc, 8) at the quadrature points, in the unit of the fine ones.

        `e` (mc, 8) are the fine moduli of the blocks' cells, 0 where a cell is void.
        """

    def moduli_with_derivatives(self, e: Array) -> tuple[Array, Array]:
        """The same and their derivatives dE_q/de_j (mc, 8 q, 8 j).

        Raises UserError if this coarsening has none.
        """
        raise UserError(
            f"coarsening {self.name!r} has no derivatives; choose average, galerkin or ddfem where "
            "they are needed"
        )

    def record(self) -> dict[str, str]:
        """Plain values that tell what it rests on, for provenance."""
        return {}
