"""Where on their surfaces two solids touch, and how stiff they are there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sound.scenes.bodies import Body
from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.hertz import compliance
from sound.scenes.materials import NamedMaterial
from sound.scenes.performance import GROUND

Array = NDArray[np.float64]


class Spots(NamedTuple):
    """What two surfaces are like at c points of contact.

    Attributes
    ----------
    vertices : (c, 2)
        The nearest of each surface; `GROUND` for the ground.
    curvatures : (c,) [1/m]
        1 / R, of the effective radius.
    giving : (c,) [1/Pa]
        1 / E, of the effective modulus; see `sound.scenes.hertz`.
    """

    vertices: NDArray[np.integer]
    curvatures: Array
    giving: Array


class Touch:
    """Surfaces of a scene, as contacts find them.

    Parameters
    ----------
    bodies
        Of the scene.
    ground
        What the ground is made of, which is flat.
    """

    def __init__(self, bodies: list[Body], ground: NamedMaterial) -> None:
        self._bodies = bodies
        self._ground = float(compliance(ground.young, ground.poisson))
        shapes = {id(body.shape): body.shape for body in bodies}
        trees = {key: cKDTree(shape.vertices) for key, shape in shapes.items()}
        self._trees = [trees[id(body.shape)] for body in bodies]

    def spots(self, pair: tuple[int, int], contacts: ContactPoints) -> Spots:
        """What the surfaces of a pair of objects are like where they touch."""
        vertices = np.full((len(contacts), 2), GROUND)
        curvatures, giving = np.zeros(len(contacts)), np.zeros(len(contacts))
        for side, number in enumerate(pair):
            if number == GROUND:
                giving += self._ground
                continue
            body = self._bodies[number]
            near = self._trees[number].query(contacts.places[:, side])[1]
            vertices[:, side] = near
            curvatures += 1.0 / body.shape.radii[near]
            giving += body.compliance[near]
        return Spots(vertices, curvatures, giving)
