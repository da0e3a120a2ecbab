"""The part of a surface that moves the air around a solid."""

import numpy as np

from carillon.arrays import Array, Integers


def outer_faces(vertices: Array, faces: Integers) -> Integers:
    """Triangles of a surface without those of closed cavities, whose air nobody hears.

    A cavity lies inside another closed part and is wound the other way round.

    Examples
    --------
    >>> import trimesh
    >>> shell = trimesh.creation.icosphere(1) + trimesh.creation.icosphere(1, 0.5)
    >>> len(outer_faces(shell.vertices, shell.faces))
    160
    >>> shell.faces[80:] = shell.faces[80:, ::-1]
    >>> len(outer_faces(shell.vertices, shell.faces))
    80
    """
    import igl

    places, numbers = np.unique(vertices, axis=0, return_inverse=True)
    joined = np.ascontiguousarray(numbers.ravel()[faces], dtype=np.int64)
    part = np.asarray(igl.facet_components(joined)[1]).ravel()
    if not part.any():
        return faces
    corners = places[joined]
    by_face = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volumes = np.bincount(part, by_face)
    is_cavity = np.zeros(len(volumes), dtype=bool)
    for each in range(len(volumes)):
        inside = np.ascontiguousarray(corners[part == each][0].mean(axis=0, keepdims=True))
        for other in np.flatnonzero(np.abs(volumes) > abs(volumes[each])):
            if volumes[each] * volumes[other] < 0.0 and not is_cavity[each]:
                own = np.ascontiguousarray(joined[part == other])
                turns = igl.fast_winding_number(np.ascontiguousarray(places), own, inside)
                is_cavity[each] = abs(float(np.ravel(turns)[0])) > 0.5
    return np.asarray(faces[~is_cavity[part]])
