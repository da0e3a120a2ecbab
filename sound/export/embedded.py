"""HDF5: the embedded finite element mesh of the surface with its eigenpairs, the paper's output."""

from pathlib import Path
from typing import Any

import h5py

from carillon.fem.embedding import embedding
from carillon.fem.model import ElasticModel
from carillon.files.datasets import put
from solver.assembly.sparse import assembled
from solver.files.model_group import FINITE_CELLS
from solver.files.modes_file import write_modes
from solver.verification.residuals import recomputed_residuals
from sound.project.design import Design
from sound.project.design_file import put_object
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid

NORMALISATION = "modes^T M modes = 1 with the mass matrix M in kg, so modes are in kg^-1/2"
SOUND = (
    "s(t) = gain sum_k a_k exp(-d_k t) sin(2 pi f_k t) over the elastic modes k, which follow six "
    "rigid ones; a_k = |u_k . f| in kg^-1/2 N s, u_k = displacement of the struck point in mode k, "
    "f = impulse in N s; within a cluster of equal frequencies a_k = (u_k . f)^2 / |U . f|"
)
EMBEDDING = "vertex value = sum over nodes c of weights[v, c] * values[{}[cell[v], c]]"


def write_embedded(path: str | Path, design: Design, parameters: dict[str, Any]) -> None:
    """Write a modes file of the solver that holds surface, embedding, dampings and targets, too.

    Raises UserError if the file cannot be written.
    """
    residuals = recomputed_residuals(*assembled(design.model), design.eigenvalues, design.modes)
    # The dataset that holds the nodes of the elements that the surface lies in.
    nodes = "cells" if isinstance(design.model, ElasticModel) else f"{FINITE_CELLS}/nodes"
    attributes: dict[str, Any] = {
        "method": "sound design",
        "normalisation": NORMALISATION,
        "sound": SOUND,
        "embedding": EMBEDDING.format(nodes),
        "mesh": str(design.settings.get("mesh", "")),
    }
    if design.up is not None:
        attributes["up"] = design.up
    if design.wall is not None:
        attributes |= {"wall": design.wall.thickness, "wall_side": design.wall.side}

    def more(target: h5py.File) -> None:
        _put_more(target, design)

    write_modes(
        path,
        design.model,
        design.eigenvalues,
        [design.modes],
        residuals,
        attributes,
        parameters,
        more,
    )


def _put_more(file: h5py.File, design: Design) -> None:
    cells, weights = embedding(design.model, design.surface_vertices)
    listening = Listening.of_design(design, SoundingSolid.of_design(design))
    put_object(file, design)
    put(file, "surface/cell", cells, "1", "row of the element that the vertex lies in or next to")
    put(file, "surface/weights", weights, "1", "weights of that element's nodes")
    put(file, "dampings", design.dampings, "1/s", "d of the elastic modes, exp(-d t)")
    put(file, "strikes/gains", listening.gains, "kg^1/2/(N s)", "samples of full scale per a_k")
