"""A design: a material for a set of targets, with its modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Complex, Integers
from carillon.errors import UserError
from carillon.fem.geometry.turning import remaining_turn
from carillon.fem.geometry.walls import ABOUT, SIDES, WallSize
from carillon.fem.model import ElasticModel, Solid
from carillon.fem.regions import RegionOf
from carillon.parameters.quantities import UP_AXES
from solver.analysis.problem import AUTO
from solver.files.modes_file import frequencies
from sound.clips.targets import Targets
from sound.project.build_evidence import is_build, is_number
from sound.radiation.far_place import RADIATIONS, FarPlace
from sound.strikes import Strike

HISTORY = {
    "seconds": ("s", "processor time since the optimisation began"),
    "evaluations": ("1", "modal analyses made so far"),
    "cost": ("1", "w_f E_f + w_a E_a + w_r R of the best material so far (Eq. 4)"),
    "frequency_cost": ("bark^2", "its E_f (Eq. 1)"),
    "amplitude_cost": ("1", "its E_a (Eq. 2)"),
    "regulariser": ("1", "its R = z^T Q z / 2 (Eq. 4)"),
}
"""Columns of a design's history: unit and meaning."""
HISTORY_TYPE = np.dtype([(name, float) for name in HISTORY])


@dataclass(frozen=True)
class FineFrequencies:
    """Frequencies (N,) [Hz] of the elastic modes of a design's fine solid, ascending, and in
    `order` (N,) the numbers of the coarse elastic modes of the same shapes.
    """

    hertz: Array
    order: Integers


@dataclass(frozen=True)
class MaterialDamping:
    """Dampings by the material.

    `loss_factors` (M,) are those of the fine cells, found for the clips' dampings, and
    `mass_per_second` [1/s] the coefficient of mass damping, as by air, half of which is part of
    every damping.  Where the regions' own damping is known, it is what counts: there are no such
    factors then.  `dampings` (N,) [1/s] are d of the elastic modes, in the order of
    `Design.frequencies`.
    """

    loss_factors: Array | None
    mass_per_second: float
    dampings: Array


@dataclass
class Design:
    """A material whose struck points sound as their clips."""

    strikes: list[Strike]
    targets: Targets
    """T struck points, and the modes that they shall have."""
    coordinates: Array
    """(m,) z of the reduced material Y = Phi z (§6), over a reference modulus."""
    young: Array
    """(M,) [Pa]: young's modulus of the fine cells, scaled so that the frequencies come nearest to
    the targets (least squares of cents)."""
    model: Solid
    """Analysed solid with its moduli."""
    eigenvalues: Array
    modes: Array
    """(6 + N,) [rad^2/s^2], (n_dofs, 6 + N) [kg^-1/2]: eigenvalues, ascending, those of the rigid
    motions first; mass-normalised modes."""
    surface_vertices: Array
    surface_faces: Integers
    """(V, 3) [m], (F, 3): vertices and triangles of the surface."""
    fine_grid: Integers
    fine_origin: Array
    fine_edge: float
    """(M, 3), (3,) [m], float [m]: integer coordinates of the fine cells, position of coordinates
    0, edge of a cell."""
    history: NDArray[np.void]
    """Rows of `HISTORY_TYPE`, see `HISTORY`."""
    settings: dict[str, Any]
    evidence: dict[str, Any]
    provenance: dict[str, Any] = field(default_factory=dict)
    """dict: the project with all defaults; method and quality of the result; origin of the numbers,
    set on reading."""
    fine: FineFrequencies | None = None
    """Frequencies of the fine solid; None if they were not computed."""
    damping: MaterialDamping | None = None
    """Loss factors of the material, and dampings by them; None in old designs."""
    fine_region: RegionOf | None = None
    """(M,) region of each fine cell, a row of the model's regions; None if there is one."""
    heard: Complex | None = None
    """(N,) [Pa m / (kg^-1/2 N s)]: pressure times distance of the elastic modes at the place where
    the design is heard, see `sound.radiation.transfer`; None if its amplitudes are those of the
    motion at the struck points."""

    @property
    def name(self) -> str:
        """What the solid is called: the name of its mesh, without folders."""
        mesh = str(self.settings.get("mesh", "")) or "solid"
        return PurePath(mesh.removeprefix("builtin:")).stem or "solid"

    @property
    def asked(self) -> dict[str, Any]:
        """The project as it was asked for: `modes` are auto if they came from what is heard."""
        heard = self.targets.left_out is not None
        return {**self.settings, "modes": AUTO} if heard else dict(self.settings)

    @property
    def unit(self) -> float:
        """Metres per unit of the coordinates of the mesh that was designed [m]."""
        return float(self.settings.get("unit", 1.0))

    @property
    def up(self) -> str | None:
        """Axis of its mesh that was turned to z; None if its axes are those of the mesh."""
        return self.settings.get("up")

    @property
    def place(self) -> FarPlace | None:
        """The place where it is heard; None if its amplitudes are those of the struck points."""
        listen = self.settings.get("listen", {})
        return FarPlace.of(listen.get("at"), self.unit, listen.get("radiation", RADIATIONS[0]))

    @property
    def wall(self) -> WallSize | None:
        """The wall that the solid is; None if its mesh encloses it."""
        thickness, side = self.settings.get("wall"), self.settings.get("wall_side", ABOUT)
        return None if thickness is None else WallSize(float(thickness), side)

    @property
    def frequencies(self) -> Array:
        """Frequencies (N,) [Hz] of the elastic modes: of the fine solid, if they are known."""
        return self.coarse_frequencies if self.fine is None else self.fine.hertz

    @property
    def coarse_frequencies(self) -> Array:
        """Frequencies (N,) [Hz] of the elastic modes of the coarse solid."""
        return frequencies(self.eigenvalues[self.model.rigid_modes :])

    @property
    def elastic_modes(self) -> Array:
        """Elastic modes (n_dofs, N) [kg^-1/2] in the order of `frequencies`, on coarse nodes."""
        elastic = self.modes[:, self.model.rigid_modes :]
        return elastic if self.fine is None else elastic[:, self.fine.order]

    @property
    def dampings(self) -> Array:
        """Dampings (N,) [1/s] of the elastic modes: of the clips (§5), or of the material."""
        source = self.settings.get("damping", {}).get("source", "clips")
        if self.damping is None or source == "clips":
            return self.targets.dampings
        return self.damping.dampings

    def remaining_turn(self, up: str | None = None) -> Array | None:
        """Rotation (3, 3) that it still needs for z to point up; None if it stands upright.

        `up` is the axis of its mesh file that points up, by default as
        `carillon.fem.geometry.turning.remaining_turn` says.
        """
        return remaining_turn(str(self.settings.get("mesh", "")), up, self.up)

    def young_near(self, positions: Array) -> Array:
        """Moduli (p,) [Pa] of the fine cells that are nearest to positions (p, 3) [m]."""
        from scipy.spatial import cKDTree

        centres = self.fine_origin + self.fine_edge * (self.fine_grid + 0.5)
        return np.asarray(self.young[cKDTree(centres).query(positions)[1]])

    def damped_by(self, source: str | None) -> Design:
        """The design with dampings of the `clips` or of the `material`; unchanged if None.

        Raises UserError if it has no loss factors of its material.
        """
        if source is None:
            return self
        if source == "material" and self.damping is None:
            raise UserError(
                "the design holds no loss factors of its material, as it was made before there "
                "were any; go on with it by design, and they are found"
            )
        settings = self.settings.get("damping", {}) | {"source": source}
        return replace(self, settings={**self.settings, "damping": settings})


def fault(design: Design) -> str:
    """The first inconsistency of a design, in a few words; empty if there is none."""
    if said := _fault_of_texts(design):
        return said
    targets = design.targets
    T, N = len(targets.names), len(targets.frequencies)
    kept, cells = design.model.rigid_modes + N, design.model.mesh.n_cells
    points = (8,) if isinstance(design.model, ElasticModel) else ()
    expected: list[tuple[str, Any, tuple[int | None, ...]]] = [
        ("strikes", design.strikes, (T,)),
        ("dampings", targets.dampings, (N,)),
        ("amplitudes", targets.amplitudes, (T, N)),
        ("residuals", targets.residuals, (T,)),
        ("rates", targets.rates, (T,)),
        ("eigenvalues", design.eigenvalues, (kept,)),
        ("modes", design.modes, (design.model.n_dofs, kept)),
        ("moduli of the coarse cells", design.model.young, (cells, *points)),
        ("coordinates", design.coordinates, (None,)),
        ("fine cells", design.fine_grid, (len(design.young), 3)),
        ("surface vertices", design.surface_vertices, (None, 3)),
        ("surface faces", design.surface_faces, (None, 3)),
    ]
    if targets.silent is not None:
        expected.append(("silent modes", targets.silent, (N,)))
    if design.fine is not None:
        expected += [
            ("fine frequencies", design.fine.hertz, (N,)),
            ("order of fine modes", design.fine.order, (N,)),
        ]
    if targets.loudness is not None:
        expected += [
            ("loudness of clips", targets.loudness.lufs, (T,)),
            ("lengths of clips", targets.loudness.seconds, (T,)),
        ]
    if design.damping is not None:
        expected.append(("dampings of the material", design.damping.dampings, (N,)))
        if design.damping.loss_factors is not None:
            expected.append(("loss factors", design.damping.loss_factors, (len(design.young),)))
    if design.heard is not None:
        expected.append(("pressures at the place where it is heard", design.heard, (N,)))
    if design.fine_region is not None:
        expected.append(("regions of fine cells", design.fine_region, (len(design.young),)))
    for name, data, shape in expected:
        own = (len(data),) if isinstance(data, (list, tuple)) else data.shape
        if not _matches(own, shape):
            any_shape = str(shape).replace("None", "any")
            return f"holds {name} of shape {own}, expected {any_shape}"
    numbers = [
        (name, data)
        for name, data, _ in expected
        if isinstance(data, np.ndarray) and data.dtype != bool
    ]
    for name, data in [*numbers, ("frequencies", targets.frequencies), ("moduli", design.young)]:
        kinds = "c" if data is design.heard else "fiu"
        if data.dtype.kind not in kinds or not np.isfinite(data).all():
            return f"holds {name} that are no finite numbers"
    if not len(targets.sounding):
        return "holds silent modes alone"
    loudness = targets.loudness
    if loudness is not None:
        if (np.abs(loudness.lufs) > MOST_LUFS).any() or (loudness.seconds <= 0.0).any():
            return f"holds loudness of clips beyond {MOST_LUFS:g} LUFS, or lengths not above 0 s"
    if design.fine is not None and sorted(design.fine.order) != list(range(N)):
        return "names other coarse modes of its fine ones than each once"
    if (design.fine_region is None) != (design.model.region is None):
        return "names the regions of one of its two solids only"
    rows = 0 if design.fine_region is None else design.fine_region
    if np.max(rows) >= len(design.model.regions) or np.min(rows) < 0:
        return "names regions of fine cells that are not there"
    count = len(design.surface_vertices)
    named = [design.surface_faces.min(), design.surface_faces.max()]
    for vertex in (*named, *(strike.vertex for strike in design.strikes)):
        if not 0 <= vertex < count:
            return f"names the surface's vertex {vertex}, of which there are {count}"
    return ""


_SETTINGS: Mapping[str, tuple[str, Callable[[Any], bool]]] = {
    "mesh": ("a text", lambda value: isinstance(value, str)),
    "unit": ("a number above 0", lambda value: is_number(value) and value > 0.0),
    "up": (f"null or one of {', '.join(UP_AXES)}", lambda value: value in (None, *UP_AXES)),
    "wall": (
        "null or a number above 0",
        lambda value: value is None or (is_number(value) and value > 0.0),
    ),
    "wall_side": (f"one of {', '.join(SIDES)}", lambda value: value in SIDES),
    "material": ("keys and values", lambda value: isinstance(value, Mapping)),
    "damping": ("keys and values", lambda value: isinstance(value, Mapping)),
    "listen": ("at, null or three numbers", lambda value: _is_listen(value)),
}
"""Settings of a design that are used: expected kind, and test of each."""
MOST_LUFS = 400.0
"""Greatest magnitude of the loudness of a clip [LUFS]."""
SOURCES = ("clips", "material")
"""Sources of a design's dampings."""


def _fault_of_texts(design: Design) -> str:
    texts: dict[str, Any] = {"settings": design.settings, "evidence": design.evidence}
    for name, value in texts.items():
        if not isinstance(value, Mapping):
            return f"holds {name} {value!r:.100}, expected keys and values"
    for key, (expected, is_such) in _SETTINGS.items():
        value = design.settings.get(key)
        if key in design.settings and not is_such(value):
            return f"holds the setting {key} {value!r:.100}, expected {expected}"
    source = design.settings.get("damping", {}).get("source", SOURCES[0])
    if source not in SOURCES:
        return f"holds the setting damping.source {source!r:.100}, expected {' or '.join(SOURCES)}"
    for key in ("cost", "cost_start"):
        value = design.evidence.get(key, 0.0)
        if not is_number(value):
            return f"holds the evidence {key} {value!r:.100}, expected a number"
    build = design.evidence.get("build")
    if build is not None and not is_build(build, len(design.model.regions)):
        return f"holds the evidence build {build!r:.100}, expected what each material is"
    return ""


def _is_listen(value: Any) -> bool:
    if not isinstance(value, Mapping):
        return False
    at = value.get("at")
    return at is None or (
        isinstance(at, (list, tuple)) and len(at) == 3 and all(is_number(each) for each in at)
    )


def _matches(own: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    return len(own) == len(expected) and all(b in (a, None) for a, b in zip(own, expected))
