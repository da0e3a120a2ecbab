"""The two surfaces at points of contact: nearest vertices, curvature and compliance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from carillon.arrays import Array
from sound.scenes.body import Body
from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.hertz import compliance
from sound.scenes.materials import NamedMaterial
from sound.scenes.performance import GROUND


class Spots(NamedTuple):
    """Two surfaces at c points of contact.

    Attributes
    ----------
    vertices : (c, 2)
        Nearest vertex of each surface; `GROUND` for the ground.
    curvatures : (c,) [1/m]
        1 / R of the effective radius R.
    compliances : (c,) [1/Pa]
        1 / E of the effective modulus E; see `sound.scenes.hertz`.
    """

    vertices: NDArray[np.integer]
    curvatures: Array
    compliances: Array


class Touch:
    """The surfaces of all bodies and of the ground, searched by position.

    Parameters
    ----------
    bodies
        All bodies of the scene.
    ground
        Material of the ground, which is flat.
    """

    def __init__(self, bodies: list[Body], ground: NamedMaterial) -> None:
        self._bodies = bodies
        self._ground = float(compliance(ground.young, ground.poisson))
        shapes = {id(body.shape): body.shape for body in bodies}
        trees = {key: cKDTree(shape.vertices) for key, shape in shapes.items()}
        self._trees = [trees[id(body.shape)] for body in bodies]

    def spots(self, pair: tuple[int, int], contacts: ContactPoints) -> Spots:
        """The surfaces of a pair of bodies at their points of contact."""
        vertices = np.full((len(contacts), 2), GROUND)
        curvatures, compliances = np.zeros(len(contacts)), np.zeros(len(contacts))
        for side, number in enumerate(pair):
            if number == GROUND:
                compliances += self._ground
                continue
            body = self._bodies[number]
            near = self._trees[number].query(contacts.places[:, side])[1]
            vertices[:, side] = near
            curvatures += 1.0 / body.shape.radii[near]
            compliances += body.compliance[near]
        return Spots(vertices, curvatures, compliances)
