"""What pictures of badly coarsened modes need, in a file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.arrays import Array
from carillon.fem.geometry import HexMesh, hexmesh_from_grid
from carillon.files.datasets import put
from carillon.files.hdf5 import create_h5, open_h5

KIND = "coarsening pictures"
SCHEMA = 1


@dataclass(frozen=True)
class ModePicture:
    """A mode of the fine solid."""

    mode: int
    """Its number, from 1."""
    displacement: Array
    """(n, 3) of the nodes of the fine mesh [kg^-1/2]."""
    energy: Array
    blame: Array
    """(m,) shares of its strain energy and of what the coarse model misses of it in each fine
    cell."""


def write_pictures(
    path: str | Path, mesh: HexMesh, pictures: Sequence[ModePicture], origin: Mapping[str, Any]
) -> None:
    """Write modes on a fine mesh, of which there may be none, with where they come from.

    Raises UserError if the file cannot be written.
    """
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        put(file, "grid", mesh.grid, "1", "integer coordinates of the cells")
        file.attrs["origin"] = mesh.origin
        file.attrs["cell_edge"] = mesh.edge
        file.create_group("provenance").attrs.update(origin)
        for index, picture in enumerate(pictures):
            group = file.create_group(f"modes/{index}")
            group.attrs["mode"] = picture.mode
            put(group, "displacement", picture.displacement, "kg^-1/2", "mode, node by node")
            put(group, "energy", picture.energy, "1", "share of the strain energy of each cell")
            put(group, "blame", picture.blame, "1", "share of the error of each cell")


def read_pictures(path: str | Path) -> tuple[HexMesh, list[ModePicture]]:
    """The fine mesh and the modes, the worst one first.

    Raises UserError if it is no such file, or damaged.
    """
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        mesh = hexmesh_from_grid(file["grid"][:], file.attrs["origin"], file.attrs["cell_edge"])
        groups = file.get("modes", {})
        pictures = [
            ModePicture(
                int(groups[name].attrs["mode"]),
                groups[name]["displacement"][:].reshape(mesh.n_nodes, 3),
                groups[name]["energy"][:].reshape(mesh.n_cells),
                groups[name]["blame"][:].reshape(mesh.n_cells),
            )
            for name in sorted(groups, key=int)
        ]
    return mesh, pictures
