"""Surfaces with rims, which are filled: found, and told with what a shell of them takes."""

import math

import numpy as np

from carillon.arrays import Surface
from carillon.command_line.logs import warn_once
from carillon.fem.geometry.facets import Facets
from carillon.fem.geometry.size import lengths_in_words

SHELL = 0.01
"""Thickness of the shell that is proposed, over the longest side of its surface."""


def rim_edges(surface: Surface) -> int:
    """Number of edges that an odd number of faces have: 0 of a closed surface.

    Vertices at one place are one.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> box = builtin_surface("box")
    >>> rim_edges(box), rim_edges(type(box)(box.vertices, box.faces[1:]))
    (0, 3)
    """
    facets = Facets.of_surface(np.asarray(surface.vertices), np.asarray(surface.faces))
    if not len(facets):
        return 0
    edge, _, triangles = facets.edges
    # Bodies that touch have the face between them twice, other meshes some face twice by mistake.
    times = np.bincount(facets.of_face[facets.of_face >= 0], minlength=len(facets))
    faces = np.bincount(edge, np.repeat(times, 3)).astype(np.int64)
    return int(np.count_nonzero((triangles % 2 == 1) & (faces % 2 == 1)))


def shell_thickness(longest: float) -> float:
    """A round thickness [m] for a shell of a surface with a `longest` side [m].

    Examples
    --------
    >>> round(shell_thickness(0.16), 6), round(shell_thickness(6.4), 6)
    (0.002, 0.05)
    """
    about = math.log10(SHELL * longest)
    rounds = [math.log10(digit) + math.floor(about) for digit in (1, 2, 5, 10)]
    return float(10.0 ** min(rounds, key=lambda each: abs(each - about)))


def say_filled(mesh: str, surface: Surface) -> None:
    """Warn, once, that what an open surface surrounds is filled, and how a shell is made of it.

    Nothing is said of closed surfaces.
    """
    rims = rim_edges(surface)
    if rims:
        thickness = lengths_in_words([shell_thickness(float(max(surface.extents)))])
        warn_once(
            f"{mesh}: its surface is open, {rims:,} of its edges have no second face; what it "
            "surrounds is filled and makes a full solid. For a shell, give --wall "
            f"{thickness.replace(' ', '')} --discretisation finite-cell, or both as keys of a file"
        )
