"""The public surface: what `import carillon as ca` offers, in one file.

Arrays are float64 and SI.  Everything runs in a plain script, and on the ranks of
`mpiexec -n RANKS python -m mpi4py SCRIPT`, all of which then call `solve` together: frequencies and
residuals are on every rank, meshes and shapes on rank 0, which writes the files.

Rooms are loaded by the functions that need them, and nothing below imports this module. Examples
suppose `import carillon as ca` and `import numpy as np`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, overload

import numpy as np
from numpy.typing import ArrayLike

from carillon.arrays import Array, Index, Surface
from carillon.composition import places
from carillon.composition.composition import PlacedRegions
from carillon.composition.entries import (
    CompositionEntry,
    Placed,
    RegionEntry,
    SolidFrame,
    SupportEntry,
    compose,
)
from carillon.composition.supports import placed_supports
from carillon.errors import UserError
from carillon.fem import materials
from carillon.fem.element import DEFAULT_POISSON
from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, load_surface, surface_name, voxelize
from carillon.fem.geometry.surface import surface_of_triangles
from carillon.fem.geometry.walls import Wall, WallSize
from carillon.fem.model import (
    DEFAULT_DENSITY,
    Constants,
    Damping,
    ElasticModel,
    Solid,
    fine_model,
)
from carillon.fem.moduli import require_moduli
from carillon.fem.regions import Regions
from carillon.notebook.card import hertz, html_or_text
from carillon.parameters import Check, checked, parameters
from carillon.parameters.quantities import (
    Count,
    Density,
    Discretisation,
    MetresPerUnit,
    PoissonRatio,
    RayleighDamping,
    Resolution,
    Seed,
    Tolerance,
    UpAxis,
    WallSide,
    WallThickness,
    Workers,
)

if TYPE_CHECKING:
    import pyvista
    import trimesh
    from matplotlib.figure import Figure
    from scipy.sparse import csr_matrix

    from carillon.processes.mpi import MPI
    from forests.model import Model
    from solver.files.modes_file import ModesFile
    from solver.refinement.errors import ExpectedErrors
    from solver.verification.audit import Audit
    from solver.verification.comparison import SpectrumComparison
    from sound.clips.extraction import ModalSound
    from sound.project.design import Design as FoundDesign
    from sound.rendering.heard_solid import HeardSolid

Young = float | str | Array | Callable[[Array], ArrayLike]

DAMPING = (30.0, 1e-6)
"""Rayleigh damping of a solid that is struck: coefficients of mass [1/s] and of stiffness [s]."""
SAMPLE_RATE = 44_100
"""Samples of a sound per second [Hz]."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """The surface of a solid, or of what its wall follows, in metres.

    Examples
    --------
    >>> bar = ca.load_mesh("builtin:bar")
    >>> bar.name, bar.hexahedra(12).n_cells
    ('bar', 18)
    """

    surface: trimesh.Trimesh
    """Its triangles, turned alike."""
    name: str = "mesh"
    """For messages and files."""
    path: str = ""
    """File that it was read from, or `builtin:NAME`; empty if there is none."""
    unit: float = 1.0
    """Metres per unit of that file."""
    wall: Wall | None = None
    """The wall that the solid is, of finite cells; None if it is what the surface encloses."""
    up: str | None = None
    """Axis of that file that points up, and was turned to z; None if the file's axes stayed."""

    @classmethod
    def of_triangles(
        cls,
        vertices: ArrayLike,
        faces: ArrayLike,
        name: str = "mesh",
        wall: float | str | None = None,
        wall_side: str = "about",
    ) -> Self:
        """The surface of vertices (v, 3) [m] and triangles (f, 3).

        Raises UserError if it is no surface around a solid; for a wall see `load_mesh`.

        Examples
        --------
        >>> corners = [[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0, 0.1, 0]]
        >>> sheet = ca.Mesh.of_triangles(corners, [[0, 1, 2], [0, 2, 3]], wall="4 mm")
        >>> sheet.extents.tolist()
        [0.2, 0.1, 0.004]
        """
        size = _wall_size(wall, wall_side)
        surface = surface_of_triangles(vertices, faces, name, is_sheet=size is not None)
        return cls(surface, name, wall=None if size is None else size.of(surface, name))

    def __repr__(self) -> str:
        return f"<Mesh {self.name!r}: {self._in_words()}>"

    def _in_words(self) -> str:
        from carillon.fem.geometry.size import length_in_words, lengths_in_words

        wall = "" if self.wall is None else f", a wall of {length_in_words(self.wall.thickness)}"
        return f"{lengths_in_words(self.extents.tolist())}, {len(self.faces):,} triangles{wall}"

    def _repr_html_(self) -> str:
        return html_or_text(self, self._html)

    def _html(self) -> str:
        from carillon.notebook.card import card
        from carillon.notebook.solid import solid
        from carillon.notebook.triangles import Triangles

        shown = Triangles.of_surface(self.skin.vertices, self.skin.faces)
        return card(f"Mesh {self.name}", [self._in_words()], solid(shown, f"Mesh {self.name}"))

    @property
    def vertices(self) -> Array:
        """Positions (v, 3) [m]."""
        return np.asarray(self.surface.vertices)

    @property
    def faces(self) -> Index:
        """Vertices (f, 3) of the triangles."""
        return np.asarray(self.surface.faces)

    @property
    def extents(self) -> Array:
        """Sides (3,) of the box around the solid [m]."""
        return np.asarray((self.wall or self.surface).extents)

    @property
    def skin(self) -> trimesh.Trimesh:
        """Triangles around the solid [m]: the surface, or both sides of its wall, whose edges are
        round but for here.
        """
        return self.surface if self.wall is None else self.wall.skin

    def to_pyvista(self) -> pyvista.PolyData:
        """The triangles of `skin` for PyVista.

        Raises UserError if that is not installed.
        """
        from carillon.drawing.with_pyvista import load_pyvista

        faces = np.asarray(self.skin.faces)
        return load_pyvista().PolyData.from_regular_faces(np.asarray(self.skin.vertices), faces)

    def hexahedra(self, resolution: int) -> HexMesh:
        """The voxels inside, `resolution` of them along the longest side.

        Raises UserError if there can be no such voxels, as of a wall, or they do not hold together.
        """
        if self.wall is not None:
            raise UserError("voxels hold no wall; take discretisation='finite-cell'")
        return hexmesh_from_voxels(voxelize(self.surface, resolution, name=self.name))


def load_mesh(
    path: str | Path,
    unit: float | str = 1.0,
    wall: float | str | None = None,
    wall_side: str = "about",
    up: str | None = None,
) -> Mesh:
    """The surface in a mesh file, or `builtin:NAME`.

    Files are OBJ, STL, PLY, OFF, glTF, 3MF, or of volume elements (Gmsh, VTU, Abaqus, ...).

    Raises UserError if there is no such mesh, or it is no surface around a solid, or none that a
    wall can follow.

    Parameters
    ----------
    unit
        Unit of the file: `m`, `cm`, `mm`, `um`, `in`, or metres per unit.
    wall
        Thickness of a wall that follows the surface, open or closed, in place of what it encloses:
        a number [m], or a text such as `0.8 mm`. Walls are for finite cells.
    wall_side
        `about`, half of it on each side of the surface, or `inside` or `outside`.
    up
        Axis of the file that points up, such as `y`: the solid is turned so that it becomes z.

    Examples
    --------
    >>> ca.load_mesh("builtin:plate", unit=0.5).extents.round(3).tolist()
    [0.12, 0.12, 0.019]
    """
    if not isinstance(path, str | Path):
        raise UserError(f"found {path!r:.80}, expected the path of a mesh file, or builtin:NAME")
    metres, size = checked("unit", unit, MetresPerUnit), _wall_size(wall, wall_side)
    name = surface_name(str(path))
    axis = None if up is None else checked("up", up, UpAxis)
    surface = load_surface(str(path), metres, is_sheet=size is not None, up=axis)
    made = None if size is None else size.of(surface, name)
    return Mesh(surface, name, str(path), metres, made, axis)


def _wall_size(wall: float | str | None, side: str) -> WallSize | None:
    checked("wall_side", side, WallSide)
    if wall is None:
        return None
    return WallSize(float(checked("wall", wall, WallThickness)), side)


def _young(young: Young) -> Young:
    if not isinstance(young, str) and not callable(young):
        _numbers("young", young, 2, "a modulus [Pa], an array, a name or a function")
    return young


Where = str | Callable[[Array], ArrayLike]


def _where(where: Where | None) -> Where | None:
    if where is not None and not isinstance(where, str) and not callable(where):
        raise ValueError(f"found {where!r:.80}, expected comparisons of x, y and z or a function")
    return where


@parameters
class Region(RegionEntry):
    """A region of a solid: what it is made of, and where it is; everywhere without a place.

    It has a `material` by name, and `young` [Pa], `poisson`, `density` [kg/m^3] and `loss_factor`
    in place of the material's. `grain` and `radial` (3,), or `pith` (3,) [m], say how wood lies;
    `grain_young` [Pa], `grain_shear` [Pa] and `grain_poisson` (3,) are those along and across it.
    Besides `where` its place may be a `box` of two corners [m], a `mesh` file, a `part` of the
    solid's own, or a `label` of the file `labels`. Raises UserError for two places at once, and for
    what belongs together and is not.

    Examples
    --------
    >>> ca.Region("handle", material="beech", grain=(1, 0, 0), where="x > 0.1").name
    'handle'
    """

    where: Annotated[Where | None, Check(_where, alone=True)] = None  # type: ignore[assignment]
    """Comparisons of x, y and z [m] that hold in it, such as `z < 0.01`; or a function of points
    (p, 3) [m] that returns which of them (p,) are in it."""

    def domain(self, solid: SolidFrame) -> places.Where:
        """See `RegionEntry.domain`."""
        return places.Chosen(self.where) if callable(self.where) else super().domain(solid)


@parameters
class Support(SupportEntry):
    """A support of a solid: a held place, a pad, springs, or a mass that is fixed to it.

    It is `where` comparisons of x, y and z [m] hold, or region:NAME, or `at` a point (3,) [m], or
    within a `radius` [m] about that. It acts `along` some axes, and holds what is there, unless it
    has a `spring` [N/m], by area [N/m^3], or a `pad` of a named material and a `thickness` [m], or
    is a `mass` [kg].

    Examples
    --------
    >>> ca.Support(where="z < 0.01", along="xy").along
    'xy'
    """


def _several_regions(regions: Any) -> tuple[RegionEntry, ...]:
    given = tuple(regions) if isinstance(regions, list | tuple) else (regions,)
    for each in given:
        if not isinstance(each, RegionEntry):
            raise ValueError(f"found {each!r:.80}, expected regions")
    CompositionEntry(given)  # which refuses two of one name
    return given


@parameters
class Material:
    """Material of a solid: its moduli, Poisson's ratio, density and damping; or its regions.

    Raises UserError for a constant that no material has.

    Examples
    --------
    >>> stiffer_above = ca.Material(lambda centres: 1e9 * (1.0 + centres[:, 2]))
    >>> ca.Material.named("steel").density
    7850.0
    >>> pan = ca.Material(
    ...     regions=[
    ...         ca.Region("body", material="iron"),
    ...         ca.Region("handle", material="beech", grain=(1, 0, 0), where="x > 0.1"),
    ...     ]
    ... )
    """

    young: Annotated[Young, Check(_young, alone=True)] = 1e9
    """Young's modulus [Pa]: one; the name of a field (`uniform`, `smooth`, `two-region`, `random`,
    `noise`) or a file of moduli; one for each voxel (m,), or for each of their quadrature points
    (m, 8); or a function of the voxels' centres (m, 3) [m] that returns (m,)."""
    poisson: PoissonRatio = DEFAULT_POISSON
    """Poisson's ratio."""
    density: Density = DEFAULT_DENSITY
    """Mass density [kg/m^3]."""
    damping: RayleighDamping = DAMPING
    """Rayleigh's coefficients of mass [1/s] and of stiffness [s], taken by `render`."""
    seed: Seed = 0
    """Seed of the fields that are drawn."""
    regions: Annotated[tuple[RegionEntry, ...], Check(_several_regions, alone=True)] = ()
    """Regions in place of modulus, Poisson's ratio and density; of several in one place the last
    one counts. Those whose damping is not known have that of the material."""
    factor: Annotated[Young, Check(_young, alone=True)] = 1.0
    """Factor on the moduli of the regions: one, one for each voxel (m,), or a function of the
    voxels' centres (m, 3) [m] that returns (m,)."""

    def __post_init__(self) -> None:
        is_one = isinstance(self.factor, int | float) and self.factor == 1.0
        if not self.regions:
            if not is_one:
                raise ValueError("factor goes with regions; give young")
            return
        for name, default in (
            ("young", 1e9),
            ("poisson", DEFAULT_POISSON),
            ("density", DEFAULT_DENSITY),
        ):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and value == default):
                raise ValueError(f"found {name} beside regions, which tell it; leave one out")

    def __repr__(self) -> str:
        if self.regions:
            return (
                f"<Material of {len(self.regions)} regions: {', '.join(map(_named, self.regions))}>"
            )
        young: Any = self.young
        if callable(young):
            told = "young by a function"
        elif np.ndim(young) == 0:
            told = f"young {young!r}" if isinstance(young, str) else f"young {float(young):.4g} Pa"
        else:
            told = f"young an array {np.shape(young)}"
        return f"<Material: {told}, poisson {self.poisson:.3g}, {self.density:,.5g} kg/m^3>"

    # Arrays of moduli have no truth value.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @classmethod
    def named(cls, name: str) -> Self:
        """A material such as `steel` or `glass`, with its constants and its damping.

        Raises UserError if there is none of that name.
        """
        from carillon.composition.materials import named_material

        row = named_material(name)
        return cls(row.young, row.poisson, row.density, (row.alpha, row.beta))

    def _table(self) -> Regions:
        """The material as the only one of a solid."""
        young = self.young if isinstance(self.young, int | float) else 1e9
        return Regions.one(self.poisson, self.density, float(young), self.damping)

    def _damped(self, placed: PlacedRegions) -> PlacedRegions:
        """Regions all of whose damping is known."""
        own = tuple(self.damping if each is None else each for each in placed.regions.damping)
        return replace(placed, regions=replace(placed.regions, damping=own))

    def moduli(self, mesh: HexMesh) -> Array:
        """Young's modulus (m,), or (m, 8) if given so, of the voxels of a mesh [Pa].

        Raises UserError if a name or a file is unknown, or for an array of another shape or of
        values that no material has.
        """
        if self.regions:
            composed = _composed(self, mesh, (), ())
            assert composed.composition is not None
            return self._of_regions(composed.composition.of_voxels(mesh), mesh)
        if isinstance(self.young, str):
            _require_no_material(self.young)
            return materials.young_modulus(self.young, mesh, self.seed)
        if callable(self.young):
            young = self.young(mesh.origin + mesh.edge * (mesh.grid + 0.5))
        else:
            young = np.full(mesh.n_cells, self.young) if np.ndim(self.young) == 0 else self.young
        return require_moduli(young, mesh.n_cells, "young")

    def _of_regions(self, placed: PlacedRegions, mesh: HexMesh) -> Array:
        """Young's modulus (m,) [Pa] of the voxels of regions."""
        if isinstance(self.factor, str):
            raise UserError(f"factor: found {self.factor!r:.80}, expected a number, or an array")
        factor: Any = self.factor
        if callable(factor):
            factor = factor(mesh.origin + mesh.edge * (mesh.grid + 0.5))
        if np.shape(factor) not in ((), (mesh.n_cells,)):
            raise UserError(
                f"factor: an array of shape {np.shape(factor)}, expected ({mesh.n_cells},)"
            )
        young = placed.regions.moduli(placed.region, factor)
        return require_moduli(np.broadcast_to(young, mesh.n_cells), mesh.n_cells, "factor")


def _named(region: RegionEntry) -> str:
    return f"{region.name} of {region.material}" if region.material else str(region.name)


def _require_no_material(young: str) -> None:
    """Say how a material such as brass is given, where its name stands in place of a modulus."""
    from carillon.composition.materials import MATERIALS

    if young in MATERIALS and not Path(young).exists():
        raise UserError(
            f"young: found {young!r}, the name of a material; give Material.named({young!r})"
        )


Given = Material | Young | None
"""A material as it may be given: what is none is its modulus; of a solid that has one, nothing else
is then changed."""
Body = Mesh | HexMesh | Solid | str | Path
"""A solid as it may be given: a surface or its file, hexahedra, or those with material."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Modes of a solid."""

    eigenvalues: Array
    """(k,) [rad^2/s^2], ascending; those of rigid motions come first, six of a free solid."""
    frequencies: Array
    """(k,) [Hz], likewise."""
    residuals: Array
    """(k,) `|K x - lambda M x| / (lambda |M x|)`."""
    shapes: Array | None
    """(k, n, 3) mass-normalised displacements [kg^-1/2] of the nodes, which are at the solid's
    `positions`; None on other ranks than 0."""
    solid: Solid | None
    """The solid, with the material that was solved; None on other ranks than 0."""
    evidence: dict[str, Any] = field(default_factory=dict)
    """Plain values by name: method, iterations, residuals reached and seconds of each phase."""

    @property
    def mesh(self) -> HexMesh:
        """Hexahedra of the solid, or the voxels that carry the material of finite cells."""
        return self._file().mesh

    def __repr__(self) -> str:
        rigid = 0 if self.solid is None else self.solid.rigid_modes
        elastic = self.frequencies[rigid:]
        count = f"{len(elastic)} {'' if self.solid is None else 'elastic '}modes"
        between = f", {hertz(elastic[0])} to {hertz(elastic[-1])} Hz" if len(elastic) else ""
        worst = float(np.max(self.residuals, initial=0.0))
        return f"<Solution: {count}{between}, residuals up to {worst:.1e}>"

    def _repr_html_(self) -> str:
        from solver.exchange.modes_html import modes_html

        return html_or_text(self, lambda: modes_html(self._file()))

    @overload
    def plot(
        self, mode: int, path: str | Path | None = ..., by: Literal["matplotlib"] = ...
    ) -> Figure: ...

    @overload
    def plot(
        self, mode: int, path: str | Path | None = ..., *, by: Literal["pyvista"]
    ) -> pyvista.Plotter: ...

    def plot(
        self, mode: int, path: str | Path | None = None, by: str = "matplotlib"
    ) -> Figure | pyvista.Plotter:
        """A picture of the solid in a mode, counted from 1, rigid ones included.

        Raises UserError if there is no such mode, PyVista is not installed, or the file cannot be
        written.

        Parameters
        ----------
        mode
            Number of the mode.
        path
            File that the picture is written to, without a window; the ending tells its kind.
        by
            `matplotlib`, which returns a figure, or `pyvista`, which returns a plotter, whose
            `show` opens it: in a window, or in the notebook.

        Examples
        --------
        >>> from tempfile import TemporaryDirectory
        >>> box = ca.solve("builtin:box", resolution=4, modes=8)
        >>> with TemporaryDirectory() as folder:
        ...     figure = box.plot(7, f"{folder}/box.png")
        >>> figure.axes[0].get_title().startswith("mode 7, ")
        True
        """
        from carillon.drawing.solid import draw
        from solver.response.points import voxel_motion

        numbers = range(1, len(self.frequencies) + 1)
        if mode not in numbers:
            raise UserError(f"mode {mode!r}: expected a whole number, 1 to {len(numbers)}")
        if by not in ("matplotlib", "pyvista"):
            raise UserError(f"by: found {by!r:.80}, expected 'matplotlib' or 'pyvista'")
        index = numbers.index(mode)
        file = self._file()
        assert file.modes is not None
        if by == "pyvista":
            from solver.exchange.modes_pyvista import plot_mode

            return plot_mode(file, index + 1, path)
        from carillon.drawing.figure import ShownFigure

        figure = ShownFigure(figsize=(6.0, 4.5), layout="constrained")
        axes = figure.add_subplot(projection="3d")
        draw(axes, file.mesh, voxel_motion(file.model, file.modes[:, index]))
        axes.set_title(f"mode {mode}, {self.frequencies[index]:.4g} Hz")
        if path is not None:
            from carillon.files.atomic import atomic_path

            with atomic_path(path) as temporary:
                try:
                    figure.savefig(temporary)
                except ValueError as error:  # an ending of no kind of picture
                    raise UserError(f"{path}: not written ({error})") from None
        return figure

    def save(self, path: str | Path) -> None:
        """Write a modes file, which all commands read.

        Raises UserError if it cannot be written.
        """
        from solver.files.modes_file import write_modes

        if self.solid is not None:
            file = self._file()
            assert file.modes is not None
            blocks = [file.modes]
            write_modes(
                path, file.model, file.eigenvalues, blocks, file.residuals, self.evidence, {}
            )

    def to_vtu(self, path: str | Path) -> None:
        """Write mesh, moduli and modes for ParaView; of finite cells the voxels with material.

        Raises UserError if it cannot be written.
        """
        from solver.exchange.modes_vtu import StreamedModes, write_all_modes

        if self.solid is not None:
            write_all_modes(path, StreamedModes.of_contents(self._file()))

    def to_pyvista(self) -> pyvista.UnstructuredGrid:
        """Mesh, moduli and modes for PyVista: vectors `mode 1` and so on at the points.

        Of finite cells it has the voxels with material. Raises UserError if PyVista is not
        installed.
        """
        from solver.exchange.modes_pyvista import modes_grid

        return modes_grid(self._file())

    def _file(self) -> ModesFile:
        from solver.files.modes_file import ModesFile

        if self.solid is None or self.shapes is None:
            raise UserError("meshes and shapes are on rank 0 alone")
        modes = self.shapes.transpose(1, 2, 0).reshape(-1, len(self.shapes))
        values = (self.eigenvalues, self.frequencies, modes, self.residuals)
        return ModesFile(*values, self.solid, self.evidence, {})


def solve(
    body: Body,
    material: Given = None,
    resolution: int = 32,
    modes: int = 60,
    method: str = "auto",
    discretisation: str = "voxel",
    initial: Solution | None = None,
    comm: MPI.Comm | None = None,
    fix: str | Sequence[str] = (),
    supports: Sequence[SupportEntry] = (),
    wall: float | str | None = None,
    wall_side: str = "about",
    **options: Any,
) -> Solution:
    """Lowest modes of a solid; collective.

    Raises UserError for anything wrong with the solid or the options, and ConvergenceError if a
    tolerance was missed.

    Parameters
    ----------
    body
        A surface, or the name of its file; hexahedra; or a solid of `coarsen` or of another
        solution, which keeps its material unless another is given.
    material
        1 GPa everywhere unless given; what is no `Material` is taken as its `young`.
    resolution
        Voxels along the longest side, of a surface.
    modes
        Number of modes, rigid ones included, of which a free solid has six.
    method
        `auto`, `lanczos`, `lobpcg` or `hcms`; ground truth by `slepc` or `arpack`.
    discretisation
        `voxel`, or `finite-cell`: the solid as it is, by quartic cells that its surface cuts.
    initial
        Modes of a similar material on the same mesh, which are corrected.
    comm
        Ranks that share the work; all that were started unless given.
    fix
        Where the solid is held: comparisons of x, y and z [m] such as `z < 0.01`, or `region:NAME`;
        one text or several.
    supports
        What else holds it, see `Support`.
    wall, wall_side
        Wall that follows the mesh of a file, see `load_mesh`; needs finite cells.
    options
        `tolerance`, `linear_solver` and the other options of `carillon modes`, with underscores.

    Examples
    --------
    >>> solution = ca.solve("builtin:bar", ca.Material.named("aluminium"), resolution=12, modes=10)
    >>> solution.frequencies[6:].round(-1).tolist()
    [1790.0, 2020.0, 3330.0, 5250.0]
    >>> softer = ca.solve(solution.solid, 0.9 * solution.solid.young, modes=10, initial=solution)
    >>> bool(abs(softer.frequencies[9] / solution.frequencies[9] - 0.9**0.5) < 1e-6)
    True
    >>> held = ca.solve("builtin:bar", resolution=12, modes=8, fix="x < -0.11")
    >>> bool(held.frequencies[0] > 10.0)
    True
    """
    from carillon.processes.mpi import MPI
    from solver.analysis import library
    from solver.distribution.collective import compute_on_root

    ranks = MPI.COMM_WORLD if comm is None else comm
    how = (resolution, discretisation, fix, supports, wall, wall_side)
    solid = compute_on_root(ranks, lambda: _solid(body, material, *how))
    start = compute_on_root(ranks, lambda: None if initial is None else _start(initial, solid))
    result = library.solve(
        solid, modes=modes, initial_modes=start, comm=ranks, method=method, **options
    )
    evidence = {"method": method, **result.evidence, "timings": result.seconds}
    evidence |= _wall_of(body, wall, wall_side) | _up_of(body)
    values = (result.eigenvalues, result.frequencies, result.residuals)
    return Solution(*values, _shapes(result.modes), solid, evidence)


def coarsen(
    body: Body,
    material: Given = None,
    resolution: int = 32,
    method: str = "ddfem",
    forests: Forests | str | Path | None = None,
    fix: str | Sequence[str] = (),
    supports: Sequence[SupportEntry] = (),
) -> Solid:
    """A solid of up to eight times fewer elements, one for each 2x2x2 block of voxels.

    Raises UserError for anything wrong with the solid, or forests for another Poisson's ratio.

    Parameters
    ----------
    body, material, resolution, fix, supports
        See `solve`; a solid with material must be one of voxels.
    method
        `ddfem`, by regression forests; `average` or `galerkin`; `fit`, what the forests learned.
    forests
        For `ddfem`: those that come along unless given.

    Examples
    --------
    >>> fine = ca.solve("builtin:bar", "two-region", resolution=16, modes=10)
    >>> coarse = ca.solve(ca.coarsen("builtin:bar", "two-region", resolution=16), modes=10)
    >>> coarse.mesh.n_cells, fine.mesh.n_cells
    (16, 72)
    >>> bool(ca.compare(coarse, fine).frequency_rms_relative_error < 0.2)
    True
    """
    from solver.coarsening.choice import make_coarsening
    from solver.coarsening.model import build_model

    fine = _solid(body, material, resolution, "voxel", fix, supports)
    file = forests.path if isinstance(forests, Forests) else forests
    coarsening = make_coarsening(method, fine.regions.ratios, file)
    young = fine.young[:, 0] if fine.young.ndim > 1 else fine.young
    region = fine.cell_regions if isinstance(fine, ElasticModel) else None
    constants: Constants = {"regions": fine.regions, "supports": fine.supports}
    return build_model(fine.mesh, young, coarsening, region=region, **constants)


def matrices(
    body: Body,
    material: Given = None,
    resolution: int = 32,
    discretisation: str = "voxel",
    fix: str | Sequence[str] = (),
    supports: Sequence[SupportEntry] = (),
) -> tuple[csr_matrix, csr_matrix]:
    """Stiffness [N/m] and mass [kg] of a solid, (3 n, 3 n), for solvers of your own.

    Row 3 i + a is the displacement of node i along axis a, at the solid's `positions`, so that an
    eigenvector reshaped to (n, 3) is a shape. Of a free solid the six least eigenvalues [rad^2/s^2]
    are zero. Raises UserError for anything wrong with the solid. Parameters: see `solve`.

    Examples
    --------
    >>> solution = ca.solve("builtin:box", resolution=4, modes=8)
    >>> K, M = ca.matrices(solution.solid)
    >>> shape = solution.shapes[6].ravel()
    >>> bool(np.isclose(shape @ K @ shape, solution.eigenvalues[6])), round(shape @ M @ shape, 9)
    (True, 1.0)
    """
    from solver.exchange.matrices import matrices as assembled

    return assembled(_solid(body, material, resolution, discretisation, fix, supports))


def read(path: str | Path) -> Solution | Design:
    """The modes in a modes file, or the design in a design file.

    Raises UserError if the file is missing, damaged or of another kind.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     ca.solve("builtin:box", resolution=4, modes=8).save(f"{folder}/box.h5")
    ...     len(ca.read(f"{folder}/box.h5").frequencies)
    8
    """
    from carillon.files.hdf5 import kind_of
    from solver.files.modes_file import read_modes
    from sound.project.design_file import read_design

    if kind_of(path, "a Carillon modes or design file (HDF5)")[0] == "design":
        return Design(read_design(path))
    file = read_modes(path)
    values = (file.eigenvalues, file.frequencies, file.residuals)
    return Solution(*values, _shapes(file.modes), file.model, file.attributes)


def compare(solution: Solution | str | Path, truth: Solution | str | Path) -> SpectrumComparison:
    """How far a spectrum is from another that is taken for the truth, on any two meshes.

    Each may be a modes file. Raises UserError if one is unusable or has no elastic modes, or they
    are of other solids.

    Examples
    --------
    >>> fine, coarse = (ca.solve("builtin:box", resolution=n, modes=12) for n in (12, 6))
    >>> bool(0.0 < ca.compare(coarse, fine).frequency_rms_relative_error < 0.05)
    True
    """
    from solver.verification.comparison import compare_modes

    return compare_modes(_modes_of(solution), _modes_of(truth))


def estimate(solution: Solution) -> ExpectedErrors:
    """How far frequencies of finite cells are expected to be above those of the solid itself.

    The `errors` of what is returned are relative, of the elastic modes up to number 60; it has
    their `rms` and the `worst`. The expected error of voxels is what `carillon modes` tells.
    Raises UserError for a solution of voxels or of a file, and where most of the strain energy is
    in cells of several materials, or that are held.

    Examples
    --------
    >>> plate = ca.solve("builtin:plate", resolution=12, modes=12, discretisation="finite-cell")
    >>> ca.estimate(plate)
    <ExpectedErrors of frequencies 7 to 12: ...>
    """
    from carillon.fem.finite_cells.model import FiniteCellModel
    from solver.accuracy.estimate import estimate_cell_errors

    if not isinstance(solution, Solution):
        raise UserError(f"found {solution!r:.100}, expected a solution")
    file = solution._file()
    if not isinstance(file.model, FiniteCellModel):
        raise UserError(
            "errors of voxels are not estimated here; expected finite cells, "
            "solve with discretisation='finite-cell'"
        )
    assert file.modes is not None
    return estimate_cell_errors(file.model, file.eigenvalues, file.modes).errors


def audit(solution: Solution | str | Path, tolerance: float = 1e-7) -> Audit:
    """Check a spectrum by itself: residuals, orthogonality, and a count by inertia.

    K and M are assembled anew; `faults` of what is returned says what is wrong, a sentence each.
    Raises UserError if the file is unusable.

    Parameters
    ----------
    solution
        Or a modes file.
    tolerance
        Relative error that the eigenvalues were asked for to.

    Examples
    --------
    >>> found = ca.audit(ca.solve("builtin:box", resolution=8, modes=12))
    >>> found.faults, found.counted == found.expected
    ([], True)
    """
    from solver.verification import audit as audits

    return audits.audit(_modes_of(solution), checked("tolerance", tolerance, Tolerance))


def render(
    source: Solution | Design | str | Path,
    at: ArrayLike | None = None,
    *,
    target: str | None = None,
    strength: ArrayLike = 1.0,
    times: ArrayLike = 0.0,
    seconds: float | None = None,
    rate: int = SAMPLE_RATE,
    contact_seconds: float = 0.0,
    damping: tuple[float, float] | None = None,
    raw: bool = False,
) -> Array:
    """Samples (s,) of the sound of one strike or of many, whose full scale is 1.

    A strike of 1 N s at a target of a design is as loud as its clip (ITU-R BS.1770).  Strikes that
    are stronger are scaled where they are beyond full scale, and peaks of others are attenuated.
    Samples of a solution are scaled to a peak of 1 dB below full scale.  An end above -60 dBFS
    fades, over a tenth of the sound, 0.5 s at most.  Raises UserError for values that are out of
    range, if a point is far from the surface or a target unknown, or if nothing sounds.

    Parameters
    ----------
    source
        Modes, a design, or the file of either.
    at : (3,) or (p, 3)
        Points of the surface that are struck [m]; of a design in the unit of its mesh.
    target
        Of a design: the target whose point is struck, in place of `at`; without both the only one.
    strength : float or (p,)
        Impulse along the inward normal [N s].
    times : float or (p,)
        When [s].
    seconds
        Length, at most 600 s; unless given, until all has decayed to -60 dBFS, at most 30 s after
        the last strike.
    rate
        Samples per second [Hz].
    contact_seconds
        Duration of the force, half a sine; 0 is an impulse.
    damping
        Of a solution: Rayleigh's coefficients of mass [1/s] and of stiffness [s]; those of its
        material unless given, and of a file that does not tell them `Material`'s default.
    raw
        Whether samples stay as they are computed: not kept within full scale, nor faded, and those
        of a solution sums of amplitudes [kg^-1/2 N s].

    Examples
    --------
    >>> bar = ca.solve("builtin:bar", resolution=12, modes=12)
    >>> samples = ca.render(bar, bar.mesh.nodes[0], seconds=0.5)
    >>> samples.shape, float(abs(samples).max().round(2))
    ((22050,), 0.89)
    """
    from sound.rendering.rendered_sound import LevelOptions, render_sound
    from sound.rendering.strikes_of_call import StrikesOfCall, listed

    strikes = StrikesOfCall(
        at=None if at is None else listed(at, 2),
        target=target,
        strength=listed(strength, 1),
        times=listed(times, 1),
        seconds=seconds,
        rate=rate,
        contact_seconds=contact_seconds,
        damping=damping,
    )
    heard = _heard(source, strikes.damping)
    hits = strikes.hits(heard)
    length, how = strikes.seconds, (strikes.rate, strikes.contact_seconds, heard.listening)
    options = LevelOptions(raw=checked("raw", raw, bool))
    return render_sound(heard.solid, hits, length, *how, options=options).samples


@dataclass(frozen=True, eq=False)
class Sound:
    """Samples with their rate, which a notebook plays.

    Raises UserError for samples that are no numbers, or a rate out of range.

    Examples
    --------
    >>> tone = ca.Sound(0.5 * np.sin(0.1 * np.arange(22_050)))
    >>> tone
    <Sound: 0.5 s at 44,100 Hz, peak -6.0 dBFS>
    >>> np.asarray(tone).shape
    (22050,)
    """

    samples: Array
    """(s,), or (s, c) of several channels; full scale is 1."""
    rate: int = SAMPLE_RATE
    """Samples per second [Hz]."""

    def __post_init__(self) -> None:
        from sound.bounds import SampleRate

        samples = _numbers("samples", self.samples, 2, "samples (s,)")
        if not np.isfinite(samples).all():
            raise UserError("samples: found NaN or infinity, expected finite numbers")
        if samples.ndim == 2 and samples.shape[1] > samples.shape[0]:
            raise UserError(
                f"samples: found {samples.shape[0]:,} samples of {samples.shape[1]:,} channels, "
                "expected (s,) or (s, c), channels last; transpose them"
            )
        object.__setattr__(self, "samples", samples)
        object.__setattr__(self, "rate", checked("rate", self.rate, SampleRate))

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The sound in a file; of several channels the loudest one, as clips are read.

        Raises UserError if it is missing, damaged or silent.
        """
        from sound.clips.wav import read_wav

        return cls(*read_wav(path, allow_clipped=True))

    @property
    def seconds(self) -> float:
        """Length [s]."""
        return len(self.samples) / self.rate

    @property
    def loudness(self) -> float:
        """Integrated loudness [LUFS] (ITU-R BS.1770); -inf of silence."""
        from sound.levels import loudness_lufs

        return loudness_lufs(self.samples, self.rate)

    def save(self, path: str | Path, bits: int = 32) -> None:
        """Write it as a sound file, see `carillon.write_wav`."""
        write_wav(path, self.samples, self.rate, bits=bits)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.samples, dtype=dtype) if copy else np.asarray(self.samples, dtype)

    def __repr__(self) -> str:
        from sound.levels import decibels

        peak = float(np.abs(self.samples).max())
        level = f"peak {decibels(peak):.1f} dBFS" if peak else "silent"
        return f"<Sound: {self.seconds:.3g} s at {self.rate:,} Hz, {level}>"

    def _repr_html_(self) -> str:
        from sound.clips.sound_html import sound_html

        return html_or_text(self, lambda: sound_html(self.samples, self.rate))


def write_wav(
    path: str | Path,
    samples: ArrayLike,
    rate: int = SAMPLE_RATE,
    *,
    bits: int = 32,
    dither_seed: int = 0,
) -> None:
    """Write samples (s,), full scale being 1, as a sound file.

    They are floats of 32 `bits`, or whole numbers of 16 or 24 with dither (TPDF), whose random
    numbers begin with a seed.  Raises UserError if they are no numbers or none at all, beyond what
    the bits hold, or cannot be written, or the name does not end in .wav.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     ca.write_wav(f"{folder}/tone.wav", np.sin(0.1 * np.arange(2000)))
    """
    from carillon.parameters.quantities import Seed
    from sound.bounds import SampleBits, SampleRate
    from sound.clips.wav import write_wav as write

    hertz, wide = checked("rate", rate, SampleRate), checked("bits", bits, SampleBits)
    seed = checked("dither_seed", dither_seed, Seed)
    numbers = _numbers("samples", samples, 2, "samples (s,)")
    write(path, numbers, hertz, bits=wide, seed=seed)


def extract(
    clip: str | Path | Sound | ArrayLike, rate: int = SAMPLE_RATE, modes: int | None = None
) -> ModalSound:
    """Frequencies, dampings and amplitudes of the modes that the recording of a strike holds.

    Raises UserError if the clip is unusable or has no modes.

    Parameters
    ----------
    clip
        A sound file, a sound, or samples (s,) at `rate` [Hz].
    modes
        Number of modes to keep, those with most energy; all that are found unless given.

    Examples
    --------
    >>> seconds = np.arange(8000) / 8000
    >>> clip = np.exp(-8.0 * seconds) * np.sin(2.0 * np.pi * 440.0 * seconds)
    >>> ca.extract(clip, 8000).frequencies.round(2).tolist()
    [440.0]
    """
    from sound.bounds import SampleRate
    from sound.clips import extraction
    from sound.clips.files import extract_file

    count = checked("modes", modes, Count | None)
    if isinstance(clip, Sound):
        rate, clip = clip.rate, clip.samples
    if isinstance(clip, str | Path):
        return extract_file(clip, count)
    hertz = checked("rate", rate, SampleRate)
    return extraction.extract(_numbers("clip", clip, 1, "a file or samples (s,)"), hertz, count)


@dataclass(frozen=True, eq=False)
class Design:
    """A material that lets struck points of a solid sound as clips do."""

    found: FoundDesign
    """All that its file holds."""

    def __repr__(self) -> str:
        from sound.export.design_html import summary

        verdict = f", {self.verdict}" if self.verdict else ""
        return f"<Design of {self.found.name!r}: {summary(self.found)}{verdict}>"

    def _repr_html_(self) -> str:
        from sound.export.design_html import design_html

        return html_or_text(self, lambda: design_html(self.found))

    @property
    def frequencies(self) -> Array:
        """Frequencies of the elastic modes (n,) [Hz], ascending."""
        return self.found.frequencies

    @property
    def target_frequencies(self) -> Array:
        """Frequencies of the clips' partials (n,) [Hz]; NaN of modes that shall stay silent."""
        targets = self.found.targets
        hertz = np.full(len(targets.frequencies), np.nan)
        hertz[targets.sounding] = targets.frequencies[targets.sounding]
        return hertz

    @property
    def verdict(self) -> str:
        """Whether it sounds like its clips, why not, and what may help; empty if unknown."""
        from sound.export.design_html import verdict_of

        return verdict_of(self.found)

    @property
    def young(self) -> Array:
        """Young's modulus (m,) of the voxels [Pa]."""
        return self.found.young

    def render(self, at: ArrayLike | None = None, **how: Any) -> Array:
        """Samples (s,) of strikes, see `carillon.render`."""
        return render(self, at, **how)

    @property
    def build(self) -> dict[str, Any] | None:
        """Materials that it is built of, errors of the partials [cents] and distance from the clip
        [dB] before and after; None of a continuous field, see `build` of a project."""
        return self.found.evidence.get("build")

    def export(self, path: str | Path, points: int = 0, format: str | None = None) -> None:
        """Write it for other tools: .h5, .gltf, .glb, .dsp (Faust), .js (Web Audio), .json or .csv
        (tables of modes), .npy (moduli), or a folder, ending in `/`, of sounds and models, or with
        the format `parts` of the parts of a design that is built of real materials.

        Raises UserError if the ending tells no format, or the file cannot be written. `points`:
        struck points of models and sounds, besides the targets'.
        """
        from sound.export.formats import FOLDER, PARTS, ExportSettings, export_design, format_of

        kind, settings = format_of(str(path), format), ExportSettings(points=points)
        if kind == PARTS:
            from sound.export.parts_folder import write_parts

            write_parts(path, self.found)
            return
        if kind != FOLDER:
            export_design(path, self.found, kind, settings)
            return
        from sound.export.engine_folder import write_engine_folder
        from sound.export.sound_set_options import SoundSetOptions

        write_engine_folder(path, self.found, SoundSetOptions(), settings)

    def save(self, path: str | Path) -> None:
        """Write a design file, which all commands read.

        Raises UserError if it cannot be written.
        """
        from sound.project.design_file import write_design

        write_design(path, self.found)


def design(project: str | Path | None = None, initial: Design | None = None, **keys: Any) -> Design:
    """Search for a material that lets struck points of a solid sound as clips do.

    Raises UserError for anything wrong with the mesh, the points, the clips or the numbers.

    Parameters
    ----------
    project
        Project file (YAML), of which `keys` replace what they name.
    initial
        Design of the same mesh to go on from.
    keys
        Keys of a project: `mesh`, `resolution`, `targets`, `optimiser` and so on, sections as
        dictionaries, `regions` and `supports` as such or as `Region` and `Support`; paths are from
        the folder of the project, or the present one.

    Notes
    -----
    Processes share the work, so that a script begins by `if __name__ == "__main__":`.

    Examples
    --------
    >>> try:
    ...     ca.design(mesh="builtin:bar", targets=[])
    ... except ca.UserError as error:
    ...     print(error)
    targets: found [], expected at least 1 of them: ...
    """
    from carillon.files.yaml_input import read_yaml
    from sound.design.optimise import optimise
    from sound.design.preparation import prepare
    from sound.project.project import project_of
    from sound.rendering.verdict import with_verdict

    described = {} if project is None else dict(read_yaml(Path(project), "a project"))
    for key, value in keys.items():
        own = described.get(key)
        if isinstance(own, Mapping) and isinstance(value, Mapping):
            value = {**own, **value}
        described[key] = _plain_entries(value)
    folder = Path() if project is None else Path(project).parent
    problem = prepare(project_of(described, folder))
    found = optimise(problem, None if initial is None else initial.found)
    if not problem.project.build.is_asked:
        return Design(with_verdict(found))
    from sound.building.cost_of_build import with_cost_of_build
    from sound.building.restriction import built

    return Design(with_cost_of_build(found, built(problem, found)))


@dataclass(frozen=True, eq=False)
class Forests:
    """Regression forests that coarsen 2x2x2 blocks of voxels.

    Examples
    --------
    >>> forests = ca.Forests.load()
    >>> soft, stiff = forests.coarsen([[1, 1, 1, 1, 2, 2, 2, 2], [3, 3, 3, 3, 6, 6, 6, 6]])
    >>> bool(np.allclose(stiff, 3.0 * soft))
    True
    """

    path: Path
    """File that they are from."""
    model: Model
    """All that it holds."""

    def __repr__(self) -> str:
        made = f"{self.model.forests.trees} trees each, objective {self.model.objective}"
        return f"<Forests of {self.path.name!r}: {made}, Poisson's ratio {self.model.poisson:g}>"

    @classmethod
    def load(cls, path: str | Path | None = None) -> Self:
        """The forests of a file, or those that come along.

        Raises UserError if they are missing or damaged.
        """
        from forests.default import default_path
        from forests.model import load_model

        file = default_path() if path is None else Path(path)
        return cls(file, load_model(file))

    @property
    def scores(self) -> dict[str, float]:
        """On samples that were held out in training, by name."""
        return self.model.scores

    def coarsen(self, young: ArrayLike) -> Array:
        """Moduli (b, 8) at the quadrature points of elements from those (b, 8) of blocks' voxels.

        Raises UserError for a bad shape, or a modulus that is negative or not finite.
        """
        from forests.evaluate import coarsen

        return coarsen(self.model, young)


def generate(path: str | Path, samples: int, workers: int = 1, **options: Any) -> None:
    """Draw random blocks, fit a coarse element to each, and write them to a shard for `train`.

    Raises UserError for impossible options, or if the file cannot be written. `options`: `seed`,
    `objective` and the other options of `carillon generate`, with underscores.

    Examples
    --------
    >>> try:
    ...     ca.generate("shard.h5", samples=0)
    ... except ca.UserError as error:
    ...     print(error)
    samples: found 0, expected at least 1: ...
    """
    from dataset_gen.generate import engine_of, generate_file
    from dataset_gen.settings import ShardOptions, settings_of
    from dataset_gen.shards import origin_of
    from dataset_gen.tasks import ShardPlan

    asked = ShardOptions(samples=samples, **options)
    settings = settings_of(asked)
    plan, origin = ShardPlan(settings), origin_of(settings, asked)
    generate_file(path, plan, origin, engine_of(checked("workers", workers, Workers)))


def train(
    shards: str | Path | Sequence[str | Path], out: str | Path, workers: int = 1, **options: Any
) -> Forests:
    """Train forests on shards of `generate`, or on samples that are never stored.

    They are written to a file. A call that was killed goes on from what it kept beside that file.
    Raises UserError for impossible options, unusable shards or too few samples. `options`: `trees`,
    `depth`, `samples` (in the place of shards) and the other options of `carillon train`, with
    underscores.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     ca.generate(f"{folder}/shard.h5", samples=200)
    ...     trained = ca.train([f"{folder}/shard.h5"], f"{folder}/forests.h5", trees=1, min_leaf=10)
    ...     same = ca.train([], f"{folder}/same.h5", samples=200, trees=1, min_leaf=10)
    >>> trained.model.forests.trees, same.model.scores == trained.model.scores
    (1, True)
    """
    from carillon.files.paths import require_writable
    from forests.training.made import SAMPLE_NAMES, SampleOptions, training_data
    from forests.training.options import TrainingOptions
    from forests.training.ranks import Ranks
    from forests.training.train import write_forests

    paths = [str(path) for path in ([shards] if isinstance(shards, str | Path) else shards)]
    require_writable(out, paths)
    made = {name: options.pop(name) for name in SAMPLE_NAMES if name in options}
    training = TrainingOptions(**options)
    dataset = training_data(paths, SampleOptions(**made), training.seed)
    write_forests(out, dataset, training, Ranks(), checked("workers", workers, Workers))
    return Forests.load(out)


def _shapes(modes: Array | None) -> Array | None:
    """Displacements (k, n, 3) from columns (3 n, k), of which they are a view."""
    return None if modes is None else modes.reshape(-1, 3, modes.shape[1]).transpose(2, 0, 1)


def _solid(
    body: Body,
    given: Given,
    resolution: int,
    discretisation: str,
    fix: str | Sequence[str] = (),
    supports: Sequence[SupportEntry] = (),
    wall: float | str | None = None,
    wall_side: str = "about",
) -> Solid:
    if wall is not None and not isinstance(body, str | Path):
        raise UserError("wall goes with the file of a mesh; give it to load_mesh or of_triangles")
    made = given if isinstance(given, Material) else Material(1e9 if given is None else given)
    if isinstance(body, Solid):
        if made.regions or fix or supports:
            raise UserError(
                "regions, fix and supports go with a surface or with hexahedra; a solid keeps what "
                "it has"
            )
        solid = body if given is None else body.with_young(made.moduli(body.mesh))
        return solid.with_regions(made._table()) if isinstance(given, Material) else solid
    if isinstance(body, Mesh | HexMesh):
        described = body
    else:
        described = load_mesh(body, wall=wall, wall_side=wall_side)
    composed = _composed(made, described, fix, supports)
    solid = _meshed(described, made, resolution, discretisation, composed)
    name = described.name if isinstance(described, Mesh) else "mesh"
    held = placed_supports(composed.supports, solid, _surface(described), name)
    return solid if held is None else solid.with_supports(held)


def _wall_of(body: Body, wall: float | str | None, side: str) -> dict[str, Any]:
    """Thickness and side of the wall of a solid, for its file; nothing if it has none."""
    own = body.wall.size if isinstance(body, Mesh) and body.wall else _wall_size(wall, side)
    return {} if own is None else {"wall": own.thickness, "wall_side": own.side}


def _up_of(body: Body) -> dict[str, Any]:
    """Axis of the mesh file that was turned to z, for the solid's file; nothing if none was."""
    return {"up": body.up} if isinstance(body, Mesh) and body.up else {}


def _composed(
    material: Material,
    body: Mesh | HexMesh,
    fix: str | Sequence[str],
    supports: Sequence[SupportEntry],
) -> Placed:
    """Regions and supports with their places."""
    fixed = tuple(fix) if isinstance(fix, list | tuple) else (fix,)
    for each in fixed:
        if not isinstance(each, str):
            raise UserError(f"fix: found {each!r:.80}, expected comparisons of x, y and z")
    held = tuple(supports) if isinstance(supports, list | tuple) else (supports,)
    for one in held:
        if not isinstance(one, SupportEntry):
            raise UserError(f"supports: found {one!r:.80}, expected supports")
    if not (material.regions or fixed or held):
        return Placed(None, ())
    frame = SolidFrame("", _surface(body), "mesh")
    if isinstance(body, Mesh):
        frame = SolidFrame(body.path, body.skin, body.name, body.unit, up=body.up)
    return compose(CompositionEntry(material.regions, held), frame, fixed)


def _surface(body: Mesh | HexMesh) -> Surface:
    """Triangles around a solid [m]."""
    if isinstance(body, Mesh):
        return body.skin
    from trimesh import Trimesh  # Its import takes long.

    from carillon.fem.geometry.faces import surface_quads

    quads = surface_quads(body)
    return Trimesh(body.nodes, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]), process=False)


def _meshed(
    body: Mesh | HexMesh, material: Material, resolution: int, discretisation: str, composed: Placed
) -> Solid:
    if isinstance(body, HexMesh):
        return _of_voxels(body, material, composed)
    count = checked("resolution", resolution, Resolution)
    if checked("discretisation", discretisation, Discretisation) == "voxel":
        return _of_voxels(body.hexahedra(count), material, composed)
    from carillon.fem.finite_cells.build import finite_cells
    from carillon.fem.finite_cells.model import finite_cell_model

    cells = finite_cells(body.wall or body.surface, count, name=body.name)
    if composed.composition is None:
        return finite_cell_model(cells, material.moduli(cells.mesh), material._table())
    placed = material._damped(composed.composition.of_cells(cells))
    young = material._of_regions(placed, cells.mesh)
    return finite_cell_model(cells, young, placed.regions, placed.region, placed.shared)


def _of_voxels(mesh: HexMesh, material: Material, composed: Placed) -> Solid:
    if composed.composition is None:
        return fine_model(mesh, material.moduli(mesh), regions=material._table())
    placed = material._damped(composed.composition.of_voxels(mesh))
    young = material._of_regions(placed, mesh)
    return fine_model(mesh, young, placed.region, regions=placed.regions)


def _plain_entries(value: Any) -> Any:
    """A value of a project; regions and supports as documents have them."""
    from carillon.parameters.documents import document_of

    if not isinstance(value, list | tuple):
        return value
    entries = (RegionEntry, SupportEntry)
    for each in value:
        if isinstance(each, Region) and callable(each.where):
            raise UserError(f"region {each.name!r}: where is a function; projects keep texts")
    return [document_of(each) if isinstance(each, entries) else each for each in value]


def _modes_of(solution: Solution | str | Path) -> ModesFile:
    from solver.files.modes_file import read_modes

    if isinstance(solution, Solution):
        return solution._file()
    if isinstance(solution, str | Path):
        return read_modes(solution)
    raise UserError(f"found {solution!r:.100}, expected a solution or the path of a modes file")


def _start(initial: Solution, solid: Solid | None) -> Array | None:
    from solver.files.initial_modes import require_same_mesh

    assert solid is not None
    file = _modes_of(initial)
    require_same_mesh("initial", file.model.node_grid, file.model.connectivity, solid)
    return file.modes


def _heard(source: Solution | Design | str | Path, damping: Damping | None) -> HeardSolid:
    from sound.rendering.heard_solid import heard_design, heard_modes

    opened = read(source) if isinstance(source, str | Path) else source
    if not isinstance(opened, Design):
        return heard_modes(_modes_of(opened), damping)
    if damping is not None:
        raise UserError("damping: goes with a solution; a design has dampings of its own")
    return heard_design(opened.found)


def _numbers(name: str, values: ArrayLike, axes: int, expected: str) -> Array:
    """Real numbers, one at least, in an array of so many axes at most."""
    try:
        array = np.asarray(values)
    except ValueError:  # Of lists that differ in length.
        array = np.empty(0)
    if array.dtype.kind not in "fiu" or not array.size or array.ndim > axes:
        raise UserError(f"{name}: found {values!r:.80}, expected {expected}")
    return np.atleast_1d(array.astype(float))
