"""What is worth a second look in a mesh that is opened: its unit, what points up, open surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Surface
from carillon.builtin_names import BUILTIN_PREFIX
from carillon.command_line.logs import warn_once
from carillon.fem.geometry.facets import Facets
from carillon.fem.geometry.size import lengths_in_words, likely_units, unit_hint
from carillon.fem.geometry.turning import likely_up
from carillon.parameters.sentences import in_keys

SHELL = 0.01
"""Thickness of the shell that is proposed, over the longest side of its surface."""


@dataclass(frozen=True)
class MeshHints:
    """What may be otherwise than a mesh was opened."""

    mesh: str
    """Path of the file."""
    extents: tuple[float, float, float]
    """Sides of the box around the solid [m]."""
    unit: float
    """Metres per unit of the mesh, as it was given."""
    units: dict[str, float]
    """Other units that it may be in, see `likely_units`."""
    up: str | None
    """Axis that seems to point up, while z does; None if none does."""
    shell: float | None
    """Thickness [m] that a shell might have, of an open surface that is filled; None of others."""
    owner: str = ""
    """Object of a scene that it is the mesh of; empty if it is of none."""

    @classmethod
    def of(
        cls,
        mesh: str,
        surface: Surface,
        unit: float = 1.0,
        up: str | None = None,
        is_wall: bool = False,
    ) -> MeshHints:
        """Hints at the mesh of a surface [m]; none of a built-in object's.

        `unit` and `up` are as they were given; of a wall, `surface` are both of its sides.

        Examples
        --------
        >>> from carillon.fem.geometry.builtin import builtin_surface
        >>> box = builtin_surface("box").apply_scale(1000.0)
        >>> hints = MeshHints.of("box.stl", type(box)(box.vertices, box.faces[1:]))
        >>> hints.units, hints.up, round(hints.shell)
        ({'mm': 0.001, 'cm': 0.01}, None, 2)
        """
        x, y, z = (float(side) for side in surface.extents)
        if mesh.startswith(BUILTIN_PREFIX):
            return cls(mesh, (x, y, z), unit, {}, None, None)
        is_filled = not is_wall and is_open(surface)
        return cls(
            mesh,
            (x, y, z),
            unit,
            likely_units((x, y, z), unit),
            likely_up(mesh, surface.bounds) if up is None else None,
            shell_thickness(max(x, y, z)) if is_filled else None,
        )

    def say_size_and_filling(self, for_file: bool = False, names_cells: bool = True) -> None:
        """Log what bears on the modes, each hint once: a doubtful unit, and an open surface.

        What mends it is an option of commands, or `for_file` a key of a project or scene.  Commands
        that take finite cells for a wall by themselves have no option that `names_cells`.
        """
        self._say_size(for_file)
        self._say_filling(for_file, names_cells)

    def say(self, for_file: bool = False) -> None:
        """Log all hints, each once: of a file's keys, or of the options of `carillon init`.

        What changes most goes first.
        """
        self._say_size(for_file)
        if self.up is not None:
            self._say(
                f"seems to stand on {self.up} = 0 and to lie on its side, since z points up here; "
                f"--up {self.up} stands it up",
                for_file,
            )
        self._say_filling(for_file, names_cells=for_file)

    def _say_size(self, for_file: bool) -> None:
        if self.units and (hint := unit_hint(self.extents, self.unit)):
            self._say(hint, for_file)

    def _say_filling(self, for_file: bool, names_cells: bool) -> None:
        if self.shell is not None:
            thickness = lengths_in_words([self.shell]).replace(" ", "")
            cells = ", which takes finite cells (--discretisation finite-cell)"
            self._say(
                "its surface is open; what it surrounds is filled and makes a full solid. For a "
                f"shell, give --wall {thickness}{cells if names_cells else ''}",
                for_file,
            )

    def _say(self, hint: str, for_file: bool) -> None:
        owner = f"object {self.owner!r}: " if self.owner else ""
        warn_once(f"{owner}{self.mesh}: {in_keys(hint) if for_file else hint}")


def is_open(surface: Surface) -> bool:
    """Whether some edges have an odd number of faces, so that the surface ends there.

    Vertices at one place are one.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> box = builtin_surface("box")
    >>> is_open(box), is_open(type(box)(box.vertices, box.faces[1:]))
    (False, True)
    """
    facets = Facets.of_surface(np.asarray(surface.vertices), np.asarray(surface.faces))
    if not len(facets):
        return False
    edge, _, triangles = facets.edges
    # Bodies that touch have the face between them twice, other meshes some face twice by mistake.
    times = np.bincount(facets.of_face[facets.of_face >= 0], minlength=len(facets))
    faces = np.bincount(edge, np.repeat(times, 3)).astype(np.int64)
    return bool(((triangles % 2 == 1) & (faces % 2 == 1)).any())


def shell_thickness(longest: float) -> float:
    """A round thickness [m] for a shell of a surface with a `longest` side [m].

    Examples
    --------
    >>> shell_thickness(0.16), shell_thickness(6.4)
    (0.002, 0.05)
    """
    about = math.log10(SHELL * longest)
    rounds = [math.log10(digit) + math.floor(about) for digit in (1, 2, 5, 10)]
    return float(f"{10.0 ** min(rounds, key=lambda each: abs(each - about)):.0e}")
