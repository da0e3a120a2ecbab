"""A solid to be struck, of a design or of modes, with its loudness and its surface."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.model import Solid
from carillon.files.hdf5 import kind_of
from solver.files.modes_file import ModesFile, read_modes
from solver.response.response import Damping
from sound.project.design import Design
from sound.project.design_file import read_design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit
from sound.rendering.solid import SoundingSolid
from sound.rendering.strike_list import ListedStrike, Point

Places = Callable[[Iterable[tuple[str, Point]]], list[tuple[Array, Array, float]]]


@dataclass(frozen=True)
class HeardSolid:
    """A solid with its loudness and its surface.

    `listening` has loudness and noise of a design's clips, and is None for modes of no design;
    `targets` are the names of the design's targets. `places` leads from points of the surface,
    each with its name in messages, to positions (3,) [m], inward normals (3,) and distances [m]
    from the points named.
    """

    solid: SoundingSolid
    listening: Listening | None
    targets: tuple[str, ...]
    places: Places

    def only_target(self) -> str:
        """The target of a design that has one; raises UserError if there is none, or a choice."""
        if not self.targets:
            raise UserError(
                "where is the solid struck? modes of no design have no target; name a point (--at)"
            )
        if len(self.targets) > 1:
            names = ", ".join(self.targets)
            raise UserError(
                f"where is the solid struck? name one of the targets (--target): {names}"
            )
        return self.targets[0]

    def hits(self, path: str | Path, strikes: Sequence[ListedStrike], strength: float) -> list[Hit]:
        """The strikes of a list, read from `path`; `strength` [N s] is that of lines without one.

        Raises UserError if a point cannot be struck, with the line.
        """
        points = {strike.point: f"line {strike.line}" for strike in reversed(strikes)}
        try:
            places = self.places((name, point) for point, name in points.items())
        except UserError as error:
            raise UserError(f"{path}: {error}") from None
        place_of = dict(zip(points, places, strict=True))
        hits = []
        for strike in strikes:
            position, inward, distance = place_of[strike.point]
            impulse = (strength if strike.strength is None else strike.strength) * inward
            hits.append(Hit(strike.seconds, position, impulse, distance))
        return hits


def open_heard_solid(
    file: str | Path,
    like: str | Path | None = None,
    damping: Sequence[float] | None = None,
    damping_from: str | None = None,
) -> HeardSolid:
    """The solid of a file, a design or modes of the solver, as it is heard.

    Modes of a designed object are heard `like` that design, other ones with Rayleigh's `damping`
    coefficients of mass [1/s] and stiffness [s], by default those in the file; `Design.damped_by`
    has the sources that dampings of a design come from.  Raises UserError if a file is unusable, or
    what is given does not go with its kind.
    """
    has_modes = kind_of(file, "a Carillon design or modes file (HDF5)")[0] == "modes"
    if not has_modes and (damping or like):
        raise UserError("--damping and --like go with modes.h5; a design has dampings of its own")
    if damping and like:
        raise UserError("--damping and --like exclude each other; a design tells all dampings")
    if has_modes and not like:
        if damping_from:
            raise UserError("--damping-from goes with a design; modes.h5 takes --damping")
        return heard_modes(read_modes(file), damping)
    design = read_design(like or file).damped_by(damping_from)
    return heard_design(design, read_modes(file) if has_modes else None)


def heard_modes(file: ModesFile, damping: Sequence[float] | None = None) -> HeardSolid:
    """The solid of any modes file, with Rayleigh damping: that given, its regions', or the
    default."""
    rayleigh = None if damping is None else Damping(*damping)
    return HeardSolid(
        SoundingSolid.of_modes(file, rayleigh), None, (), _places_of_model(file.model)
    )


def heard_design(design: Design, truth: ModesFile | None = None) -> HeardSolid:
    """A design as its clips are heard, by its own modes or by those of another mesh."""
    if truth is None:
        solid = SoundingSolid.of_design(design)
    else:
        solid = SoundingSolid.of_truth(truth, design)
    names = tuple(strike.name for strike in design.strikes)
    return HeardSolid(solid, Listening.of_design(design, solid), names, _places_of_design(design))


def _places_of_design(design: Design) -> Places:
    """Targets, and vertices of the surface."""
    targets = {strike.name: (strike.position, strike.inward, 0.0) for strike in design.strikes}

    def places(points: Iterable[tuple[str, Point]]) -> list[tuple[Array, Array, float]]:
        import trimesh

        from solver.response.vertices import inward_normals
        from sound.strikes import Place, vertex_of

        surface = trimesh.Trimesh(design.surface_vertices, design.surface_faces, process=False)
        struck_places: list[tuple[Array, Array, float] | None] = []
        vertices, distances = [], []
        for name, point in points:
            if point.target is None:
                place = Place(name, point.at, point.vertex)
                vertex, distance = vertex_of(surface, place, design.unit)
                vertices.append(vertex)
                distances.append(distance)
                struck_places.append(None)
            elif point.target in targets:
                struck_places.append(targets[point.target])
            else:
                raise UserError(
                    f"{name}: the design has no target {point.target!r}, expected one of "
                    f"{', '.join(targets)}"
                )
        positions = design.surface_vertices[vertices]
        inward = inward_normals(surface, positions) if vertices else positions
        struck = zip(positions, inward, distances, strict=True)
        return [next(struck) if place is None else place for place in struck_places]

    return places


def _places_of_model(model: Solid) -> Places:
    """Points of a model's own surface."""

    def places(points: Iterable[tuple[str, Point]]) -> list[tuple[Array, Array, float]]:
        from solver.response.surface import REACH, surface_of
        from sound.strikes import TOO_FAR

        surface = surface_of(model)
        longest = float(np.ptp(surface.points, axis=0).max())
        reach = max(TOO_FAR * longest, REACH * surface.edge)
        struck = []
        for name, point in points:
            if point.at is None:
                raise UserError(
                    f"{name}: a modes file knows neither targets nor the vertices of a surface; "
                    "strike it at a point (--at), or name its design (--like)"
                )
            position, inward = surface.place(np.array(point.at), name, reach)
            struck.append((position, inward, float(np.linalg.norm(position - point.at))))
        return struck

    return places
