"""The file of a design, `design.h5`."""

import json
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from carillon.errors import UserError
from carillon.files.datasets import put
from carillon.files.hdf5 import create_h5, open_h5
from carillon.records import provenance
from carillon.records.measurement import measured
from solver.files.model_group import get_model, put_model
from solver.files.modes_file import put_eigenvalues, put_modes
from sound.clips.targets import ClipLoudness, Targets
from sound.project.design import (
    HISTORY,
    HISTORY_TYPE,
    Design,
    FineFrequencies,
    MaterialDamping,
    fault,
)
from sound.strikes import Strike

KIND = "design"
SCHEMA = 1


def write_design(path: str | Path, design: Design) -> None:
    """Write a design atomically.

    Raises UserError if the file cannot be written, and ValueError if its parts do not fit each
    other.
    """
    wrong = fault(design)
    if wrong:
        raise ValueError(wrong)
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        put_object(file, design)
        put(file, "coordinates", design.coordinates, "1", "z of the reduced material, Y = Phi z")
        put_eigenvalues(file, design.eigenvalues)
        put_modes(file, [design.modes], (design.model.n_dofs, len(design.eigenvalues)))
        put_model(file.create_group("coarse"), design.model)
        for name, (units, meaning) in HISTORY.items():
            put(file, f"history/{name}", design.history[name], units, meaning)
        _put_text(file, "settings", json.dumps(design.settings), "the project as resolved, JSON")
        _put_text(file, "evidence", json.dumps(design.evidence), "how the result was got, JSON")
        file.create_group("provenance").attrs.update(measured(design.settings))


def put_object(file: h5py.File, design: Design) -> None:
    """Write struck points, targets, surface and fine cells, which do not depend on the analysis."""
    _put_strikes(file.create_group("strikes"), design.strikes)
    _put_targets(file.create_group("targets"), design.targets)
    put(file, "surface/vertices", design.surface_vertices, "m", "vertices of the surface")
    put(file, "surface/faces", design.surface_faces, "1", "vertex numbers of the triangles")
    put(file, "fine/grid", design.fine_grid, "1", "integer coordinates of the fine cells")
    put(file, "fine/young", design.young, "Pa", "Young's modulus of the fine cells")
    put(file, "fine/origin", design.fine_origin, "m", "position of grid coordinates (0, 0, 0)")
    put(file, "fine/edge", np.array([design.fine_edge]), "m", "edge of a fine cell")
    if design.fine is not None:
        put(file, "fine/frequencies", design.fine.hertz, "Hz", "elastic modes of the fine solid")
        put(file, "fine/order", design.fine.order, "1", "coarse elastic mode of the same shape")
    if design.damping is not None:
        _put_damping(file["fine"], design.damping)
    if design.heard is not None:
        meaning = "pressure times distance of the elastic modes where the design is heard"
        unit = "Pa m kg^1/2 N^-1 s^-1"
        put(file, "heard/real", design.heard.real, unit, f"{meaning}, real part")
        put(file, "heard/imaginary", design.heard.imag, unit, f"{meaning}, imaginary part")
    if design.fine_region is not None:
        put(file, "fine/region", design.fine_region, "1", "region of the fine cells")


def read_design(path: str | Path) -> Design:
    """Read a design.

    Raises UserError if the file is missing, damaged, of another kind or schema, or inconsistent.
    """
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        fine = file["fine"]
        columns = [file[f"history/{name}"][()] for name in HISTORY]
        design = Design(
            _get_strikes(file["strikes"]),
            _get_targets(file["targets"]),
            file["coordinates"][()],
            file["fine/young"][()],
            get_model(file["coarse"]),
            file["eigenvalues"][()],
            file["modes"][()],
            file["surface/vertices"][()],
            file["surface/faces"][()],
            file["fine/grid"][()],
            file["fine/origin"][()],
            float(file["fine/edge"][0]),
            np.rec.fromarrays(columns, dtype=HISTORY_TYPE).view(np.ndarray),
            json.loads(file["settings"].asstr()[()]),
            json.loads(file["evidence"].asstr()[()]),
            provenance.read(file),
            FineFrequencies(fine["frequencies"][()], fine["order"][()])
            if "frequencies" in fine
            else None,
            _get_damping(fine),
            fine["region"][()].astype(np.uint16) if "region" in fine else None,
            file["heard/real"][()] + 1j * file["heard/imaginary"][()] if "heard" in file else None,
        )
    wrong = fault(design)
    if wrong:
        raise UserError(f"{path}: {wrong}; make the design again")
    return design


def _put_damping(group: h5py.Group, damping: MaterialDamping) -> None:
    if damping.loss_factors is not None:
        put(group, "loss_factors", damping.loss_factors, "1", "loss factor of the fine cells")
        mass = np.array([damping.mass_per_second])
        put(
            group, "mass_per_second", mass, "1/s", "twice the damping that all modes have in common"
        )
    put(group, "dampings", damping.dampings, "1/s", "of the elastic modes, by the material")


def _get_damping(group: h5py.Group) -> MaterialDamping | None:
    if "dampings" not in group:
        return None
    if "loss_factors" not in group:
        return MaterialDamping(None, 0.0, group["dampings"][()])
    mass = float(group["mass_per_second"][0])
    return MaterialDamping(group["loss_factors"][()], mass, group["dampings"][()])


def _put_strikes(group: h5py.Group, strikes: Sequence[Strike]) -> None:
    _put_text(group, "names", [strike.name for strike in strikes], "names of the targets")
    put(group, "vertices", np.array([s.vertex for s in strikes]), "1", "struck surface vertices")
    put(group, "positions", np.array([s.position for s in strikes]), "m", "where they are")
    put(group, "inward", np.array([s.inward for s in strikes]), "1", "unit vectors into the solid")


def _get_strikes(group: h5py.Group) -> list[Strike]:
    names, vertices = group["names"].asstr()[()], group["vertices"][()]
    rows = zip(names, vertices, group["positions"][()], group["inward"][()])
    return [Strike(str(name), int(vertex), at, inward) for name, vertex, at, inward in rows]


def _put_targets(group: h5py.Group, targets: Targets) -> None:
    _put_text(group, "names", list(targets.names), "names of the clips")
    put(group, "frequencies", targets.frequencies, "Hz", "frequencies shared by the clips")
    put(group, "dampings", targets.dampings, "1/s", "d of a mode that decays as exp(-d t)")
    put(group, "amplitudes", targets.amplitudes, "full scale", "amplitudes at the strike, per clip")
    put(group, "rates", np.array(targets.rates), "Hz", "sampling rates of the clips")
    if targets.silent is not None:
        silent = targets.silent.astype(np.uint8)
        left_out = np.zeros(0) if targets.left_out is None else targets.left_out
        put(group, "left_out", left_out, "Hz", "partials that no mode has")
        group["left_out"].attrs["share_of_loudness"] = targets.left_out_share
        put(group, "silent", silent, "1", "1 of modes that are no partials and shall not sound")
    for number, residual in enumerate(targets.residuals):
        put(group, f"residuals/{number}", residual, "full scale", "a clip less its modes")
    if targets.loudness is not None:
        meaning = "integrated loudness of each clip from its strike on (ITU-R BS.1770)"
        put(group, "loudness/lufs", targets.loudness.lufs, "LUFS", meaning)
        put(group, "loudness/seconds", targets.loudness.seconds, "s", "time that it is of")


def _get_targets(group: h5py.Group) -> Targets:
    names = tuple(str(name) for name in group["names"].asstr()[()])
    silent, left_out, share = None, None, 0.0
    if "left_out" in group:
        silent, left_out = group["silent"][()].astype(bool), group["left_out"][()]
        share = float(group["left_out"].attrs["share_of_loudness"])
    return Targets(
        names,
        group["frequencies"][()],
        group["dampings"][()],
        group["amplitudes"][()],
        tuple(group[f"residuals/{number}"][()] for number in range(len(names))),
        tuple(int(rate) for rate in group["rates"][()]),
        ClipLoudness(group["loudness/lufs"][()], group["loudness/seconds"][()])
        if "loudness" in group
        else None,
        silent,
        left_out,
        share,
    )


def _put_text(group: h5py.Group, name: str, text: str | list[str], long_name: str) -> None:
    dataset = group.create_dataset(name, data=text, dtype=h5py.string_dtype())
    dataset.attrs["units"] = "1"
    dataset.attrs["long_name"] = long_name
