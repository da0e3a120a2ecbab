"""The solid on the studio's bench: its surface, voxels and modes, and what it sounds like."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from carillon.arrays import Array
from carillon.composition.entries import CompositionEntry
from carillon.fem.geometry.hints import MeshHints
from carillon.fem.geometry.walls import WallSize
from carillon.fem.model import Solid
from carillon.processes.threads import one_thread
from solver.analysis.modes import Modes
from solver.analysis.problem import ProblemOptions
from solver.files.modes_file import frequencies
from solver.response.points import interpolation
from solver.response.response import Damping
from solver.response.vertices import inward_normals
from sound.design.descent import cost_of
from sound.design.fine_check import FINE_TOLERANCE
from sound.design.optimise import optimise
from sound.design.pitch import stretch_to
from sound.design.preparation import (
    DesignProblem,
    PreparedSolid,
    coordinates_of,
    prepare,
    prepared_solid,
)
from sound.design.simulation import TOLERANCE, Evaluation, Simulation
from sound.design.tasks import Setting
from sound.project.design import Design
from sound.project.design_file import read_design, write_design
from sound.project.project import Project
from sound.project.settings import MaterialSettings
from sound.strikes import Place, Strike, locate_all, struck_surface
from studio.binary import pack
from studio.processes.bank import Aim, Heard, bank
from studio.processes.search import history_of
from studio.rows import KINDS

MODES = 30
"""Elastic modes of a solid that has no targets yet."""


@dataclass(frozen=True)
class SurfaceNews:
    """A surface as the page gets it, and how large it is."""

    message: bytes
    vertices: int
    triangles: int
    hints: MeshHints


class SolidProcess:
    """What the process for the solid does, step by step: `read`, `prepare`, `aim`, then banks."""

    def __init__(self) -> None:
        self._surface: trimesh.Trimesh
        self._inward: Array
        self._prepared: PreparedSolid
        self._solid: ProblemOptions
        self._problem: DesignProblem | None = None
        self._own: _Sounding | None = None
        self._fine: _Sounding | None = None

    def read(
        self, mesh: str, unit: float, wall: WallSize | None, up: str | None, number: int
    ) -> SurfaceNews:
        """The surface of a mesh, or both sides of its wall, whose message has a `number`."""
        surface = struck_surface(mesh, unit, wall=wall, up=up)
        positions = np.asarray(surface.vertices, dtype=float)
        self._surface, self._inward = surface, inward_normals(surface, positions)
        faces = np.asarray(surface.faces)
        message = pack(
            {"event": "surface", "number": number, "unit": unit},
            {
                "positions": ("f4", positions),
                "inward": ("f4", self._inward),
                "triangles": ("u4", faces),
            },
        )
        hints = MeshHints.of(mesh, surface, unit, up, is_wall=wall is not None)
        return SurfaceNews(message, len(positions), len(faces), hints)

    def prepare(
        self, solid: ProblemOptions, material: MaterialSettings, composition: CompositionEntry
    ) -> dict[str, int]:
        """Voxels, material and modes of the solid whose surface was read; how many of them."""
        self._prepared = prepared_solid(solid, material, self._surface, composition)
        self._solid, self._problem = solid, None
        self._own = self._fine = None
        return {"voxels": self._prepared.mesh.n_cells, "unknowns": self._sounding().model.n_dofs}

    def place(self, places: Sequence[Place]) -> list[Strike]:
        """Struck points of the surface."""
        return locate_all(self._surface, places, self._solid.unit)

    def aim(self, project: Project | None) -> dict[str, Any] | None:
        """Take up what the solid shall sound like; the modes that all clips share."""
        self._problem = None
        self._own = self._fine = None
        if project is None:
            return None
        self._problem = prepare(project, solid=self._prepared)
        targets = self._problem.setting.objective.targets
        return {
            "hertz": targets.frequencies.tolist(),
            "dampings_per_second": targets.dampings.tolist(),
            "amplitudes": targets.amplitudes.tolist(),
        }

    def problem(self) -> bytes:
        """What a search needs, for its process."""
        return pickle.dumps(self._problem)

    def is_of_targets(self, design: str) -> bool:
        """Whether a design in a file was made for the present targets, regions and supports."""
        return self._is_of_targets(read_design(design))

    def design(
        self,
        material: str | Sequence[float] | None,
        out: str,
        rows: Sequence[Mapping[str, float]],
        other: Sequence[float] | None = None,
    ) -> list[float]:
        """Write the design of a material for the present targets; its coordinates.

        The material is that of another design, or one of coordinates, or the uniform one; `rows`
        are the history of how it was found.  The one of `other` coordinates takes its place if its
        cost is less.
        """
        assert self._problem is not None
        z = material
        if isinstance(material, str):
            z = self._coordinates(read_design(material))
        project = self._problem.project
        once = replace(project.optimiser, seconds=None, evaluations=1, workers=1)
        problem = replace(self._problem, project=replace(project, optimiser=once))
        materials = [None if z is None else np.asarray(z)]
        if other is not None:
            materials.append(np.asarray(other))
        designs = [optimise(problem, coordinates=at, history=history_of(rows)) for at in materials]
        made = min(designs, key=lambda design: design.evidence["cost"])
        write_design(out, made)
        return made.coordinates.tolist()

    def bank(
        self,
        z: Sequence[float] | None,
        header: dict[str, Any],
        hertz: Array | None = None,
    ) -> bytes:
        """The bank of a material, of the uniform one if z is None, whose modes are known to sound
        at `hertz` (N,).
        """
        return self._bank(self._sounding(), z, header, hertz)

    def fine_bank(self, z: Sequence[float] | None, header: dict[str, Any]) -> bytes:
        """The bank of a material on the solid that the coarse one stands for."""
        if self._fine is None:
            setting = self._setting()
            fine = setting.fine() if setting.is_coarsened else setting
            self._fine = _Sounding(self._simulation(fine, FINE_TOLERANCE), self._surface)
        return self._bank(self._fine, z, header, None)

    def bank_of(self, design: str, header: dict[str, Any]) -> bytes:
        """The bank of a design in a file: by its own modes, if it is of the present targets."""
        made = read_design(design)
        if not self._is_of_targets(made):
            return self.bank(self._coordinates(made), header)
        sounding = self._sounding()
        heard = Heard(
            made.frequencies,
            made.dampings,
            sounding.pushed(made.model, made.elastic_modes, self._inward),
            self._at_vertices(made.young),
            made.heard,
        )
        told = {
            "cost": made.evidence.get("cost"),
            "checked": bool(made.evidence.get("checks")),
            "rigid_motions": made.model.rigid_modes,
            "verdict": (made.evidence.get("verdict") or {}).get("sentence"),
            "ended_by": made.evidence.get("ended_by"),
        }
        return bank(heard, self._positions, self._aimed(), {**told, **header})

    def fine_bank_of(self, design: str, header: dict[str, Any]) -> bytes:
        """The bank of a design's material on the solid that the coarse one stands for."""
        return self.fine_bank(self._coordinates(read_design(design)), header)

    def _is_of_targets(self, design: Design) -> bool:
        if self._problem is None:
            return False
        own, targets = self._problem.project.as_dict(), self._problem.setting.objective.targets
        if any((design.settings.get(kind) or []) != own[kind] for kind in KINDS):
            return False
        is_of_place = design.heard is not None or own["listen"]["at"] is not None
        if is_of_place and design.settings.get("listen") != own["listen"]:
            return False
        return design.targets.names == targets.names and np.array_equal(
            design.targets.frequencies, targets.frequencies
        )

    def _coordinates(self, design: Design) -> list[float] | None:
        """Coordinates of a design's material, by the law and dimensions that hold now."""
        if self._problem is not None:
            return coordinates_of(self._problem, design).tolist()
        own = design.coordinates
        return own.tolist() if len(own) == self._prepared.material.dimensions else None

    def _bank(
        self,
        sounding: _Sounding,
        z: Sequence[float] | None,
        header: dict[str, Any],
        hertz: Array | None,
    ) -> bytes:
        material = self._prepared.material
        at = np.zeros(material.dimensions) if z is None else np.asarray(z)
        with one_thread():
            evaluation = sounding.evaluate(at)
        own = frequencies(evaluation.eigenvalues) if hertz is None else np.asarray(hertz)
        elastic = sounding.elastic(evaluation)
        aim, young, keys = self._aimed(), material.moduli(at), dict(header)
        dampings, transfer = None, None
        if aim is None:
            dampings = Damping().decay_per_second(evaluation.eigenvalues)
        else:
            assert self._problem is not None
            objective = self._problem.setting.objective
            transfer = objective.heard
            if not objective.absolute:
                factor = stretch_to(np.sort(own), aim.targets)
                own, young = factor * own, factor**2 * young
            keys.setdefault("cost", cost_of(objective, material, evaluation).total)
        pushed = sounding.pushed(sounding.model, elastic, self._inward)
        at_place = None if transfer is None else transfer.heard(sounding.model, elastic, own)
        heard = Heard(own, dampings, pushed, self._at_vertices(young), at_place)
        told = {"cost": None, "checked": False, "rigid_motions": sounding.model.rigid_modes}
        return bank(heard, self._positions, aim, {**told, **keys})

    @property
    def _positions(self) -> Array:
        return np.asarray(self._surface.vertices, dtype=float)

    def _aimed(self) -> Aim | None:
        if self._problem is None:
            return None
        setting = self._problem.setting
        vertices = np.array([strike.vertex for strike in setting.strikes])
        return Aim(setting.objective.targets, vertices)

    def _at_vertices(self, young: Array) -> Array:
        return np.asarray(young[self._sounding().nearest])

    def _sounding(self) -> _Sounding:
        if self._own is None:
            simulation = self._simulation(self._setting())
            self._own = _Sounding(simulation, self._surface, self._prepared)
        return self._own

    def _setting(self) -> Setting:
        """Of the search; one that aims at nothing before there are targets."""
        if self._problem is not None:
            return self._problem.setting
        parts = self._prepared
        anywhere = Strike("", 0, self._positions[0], self._inward[0])
        nothing: Any = None
        return parts.setting(self._solid, [anywhere], nothing)

    def _simulation(self, setting: Setting, tolerance: float = TOLERANCE) -> Simulation:
        with one_thread():
            return setting.simulation(tolerance, None if self._problem is not None else MODES)


class _Sounding:
    """A simulation that is followed from one material to the next, seen at all vertices."""

    def __init__(
        self,
        simulation: Simulation,
        surface: trimesh.Trimesh,
        prepared: PreparedSolid | None = None,
    ) -> None:
        self._simulation = simulation
        self._vertices = np.asarray(surface.vertices, dtype=float)
        self._values = interpolation(simulation.model, self._vertices)
        self._last: Modes | None = None
        if prepared is not None:
            mesh = prepared.mesh
            centres = mesh.origin + mesh.edge * (mesh.grid + 0.5)
            self.nearest = cKDTree(centres).query(self._vertices)[1]

    @property
    def model(self) -> Solid:
        """The solid that is analysed."""
        return self._simulation.model

    def evaluate(self, z: Array) -> Evaluation:
        """Modes at the coordinates z."""
        evaluation = self._simulation.evaluate_anyway(z, self._last)
        self._last = evaluation.modes
        return evaluation

    def elastic(self, evaluation: Evaluation) -> Array:
        """Its elastic modes (3 n, N) on the nodes of the model."""
        return self._simulation.mesh_rows(evaluation.modes.elastic)

    def pushed(self, model: Solid, elastic: Array, inward: Array) -> Array:
        """What unit impulses (V, 3) at all vertices push the modes (3 n, N) of a model by."""
        values: csr_matrix = self._values
        if model.n_nodes != self.model.n_nodes:
            values = interpolation(model, self._vertices)
        modes = elastic.reshape(model.n_nodes, 3, -1)
        return np.asarray(
            sum(inward[:, axis, None] * (values @ modes[:, axis]) for axis in range(3))
        )
