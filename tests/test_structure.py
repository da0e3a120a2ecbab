"""Which package may import which: every arrow is listed, and none points back."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
ROOMS = ("carillon", "dataset_gen", "forests", "solver", "sound", "studio", "workflow")

EVERYBODY = ("carillon", "carillon.fem", "carillon.fem.geometry", "carillon.fem.finite_cells")
"""Packages that all others may import."""

ARROWS = {
    "carillon": "",
    "carillon.fem.geometry": "carillon",
    "carillon.fem": "carillon carillon.fem.geometry",
    "carillon.fem.finite_cells": "carillon carillon.fem carillon.fem.geometry",
    #
    "dataset_gen.objectives": "",
    "dataset_gen": "dataset_gen.objectives",
    "dataset_gen.commands": "dataset_gen",
    #
    "forests": "",
    "forests.training": "dataset_gen dataset_gen.objectives forests",
    "forests.comparison": "dataset_gen dataset_gen.objectives forests",
    "forests.studies": "dataset_gen forests forests.training",
    "forests.commands": "forests forests.training forests.comparison forests.studies",
    #
    "solver.coarsening": "dataset_gen.objectives forests",
    "solver.distribution": "",
    "solver.files": "solver.distribution",
    "solver.response": "solver.files solver.subspace",
    "solver.assembly": "solver.distribution",
    "solver.linear": "solver.distribution solver.assembly",
    "solver.subspace": "solver.distribution solver.assembly",
    "solver.hcms": "solver.distribution solver.assembly solver.linear solver.subspace",
    "solver.correction": "solver.distribution solver.assembly solver.linear solver.subspace",
    "solver.reference": "solver.assembly solver.linear solver.subspace",
    "solver.analysis": """dataset_gen.objectives solver.coarsening solver.distribution solver.files
        solver.assembly solver.linear solver.subspace solver.hcms solver.correction
        solver.reference""",
    "solver.refinement": """solver.coarsening solver.distribution solver.files solver.assembly
        solver.linear solver.subspace solver.correction solver.analysis""",
    "solver.accuracy": """solver.distribution solver.files solver.analysis
        solver.refinement""",
    "solver": "solver.analysis",
    "solver.studies": """solver.coarsening solver.distribution solver.files solver.response
        solver.assembly solver.linear solver.subspace solver.hcms solver.correction
        solver.reference solver.analysis""",
    "solver.studies.accuracy": """solver.assembly solver.linear solver.analysis solver.refinement
        solver.accuracy solver.studies""",
    "solver.studies.benchmark": """solver.coarsening solver.distribution solver.files
        solver.assembly solver.linear solver.subspace solver.reference solver.correction
        solver.analysis solver.studies""",
    "solver.studies.calibration": """dataset_gen.objectives solver.coarsening solver.assembly
        solver.analysis""",
    "solver.studies.coarsening": """solver.coarsening solver.files solver.analysis
        solver.refinement solver.studies""",
    "solver.studies.discretisation": """solver.coarsening solver.files solver.analysis
        solver.refinement solver.accuracy solver.studies""",
    "solver.studies.scaling": """solver.distribution solver.assembly solver.linear solver.hcms
        solver.correction solver.analysis""",
    "solver.commands": """dataset_gen.objectives solver.distribution solver.files solver.response
        solver.linear solver.correction solver.analysis solver.refinement solver.accuracy
        solver.studies solver.studies.benchmark
        solver.studies.calibration solver.studies.scaling solver.coarsening
        solver.studies.accuracy solver.studies.coarsening solver.studies.discretisation""",
    #
    "sound": "",
    "sound.clips": "sound",
    "sound.project": "solver.files solver.analysis sound sound.clips",
    "sound.design": """solver.coarsening solver.distribution solver.files solver.response
        solver.linear solver.subspace solver.analysis sound sound.clips sound.project""",
    "sound.rendering": """solver.files solver.response solver.subspace sound sound.clips
        sound.project""",
    "sound.scenes": """solver.analysis solver.files solver.refinement solver.response
        solver.accuracy sound sound.project sound.rendering""",
    "sound.scenes.contact": "sound.scenes",
    "sound.scenes.audible": "solver.response sound.rendering sound.scenes sound.scenes.contact",
    "sound.scenes.film": "sound sound.scenes",
    "sound.scenes.playing": "sound.clips sound.scenes sound.scenes.audible sound.scenes.contact",
    "sound.export": """solver.files solver.response solver.assembly solver.studies sound
        sound.project sound.rendering sound.scenes""",
    "sound.commands": """solver.response sound sound.clips sound.project sound.design
        sound.rendering sound.export""",
    #
    "studio": "",
    "studio.standalone": "sound sound.project sound.design sound.rendering studio",
    "studio.scene": "solver.refinement sound.scenes studio studio.standalone",
    "studio.processes": """solver.files solver.response solver.analysis sound sound.clips
        sound.project sound.design sound.rendering sound.export studio studio.standalone""",
    "studio.session": "sound sound.clips sound.project studio studio.processes",
    "studio.server": "sound.project studio",
    "studio.commands": """solver.refinement sound sound.clips sound.project sound.scenes
        sound.scenes.film sound.scenes.playing sound.export studio.standalone studio.scene
        studio.server studio.session""",
    #
    "workflow": "dataset_gen dataset_gen.objectives forests forests.studies",
    "workflow.estimate": """dataset_gen.objectives solver.coarsening solver.refinement
        workflow""",
    "workflow.studies.base": "solver.response workflow",
    "workflow.studies": "workflow.studies.base",
    "workflow.studies.report": """solver.files solver.hcms solver.refinement
        solver.studies.scaling workflow workflow.studies.base""",
    "workflow.studies.figures": "workflow.studies.base workflow.studies.report",
    "workflow.studies.claims": "forests workflow workflow.studies.base workflow.studies.report",
    "workflow.studies.forests": """dataset_gen.objectives workflow.studies.base
        workflow.studies.report""",
    "workflow.studies.objectives": """dataset_gen.objectives solver.coarsening
        workflow.studies.base""",
    "workflow.studies.coarsening": "solver.studies.coarsening workflow.studies.base",
    "workflow.studies.discretisation": "workflow.studies.base",
    "workflow.studies.accuracy": "workflow.studies.base",
    "workflow.studies.sounds": """solver.files solver.response sound sound.clips sound.project
        sound.design sound.rendering workflow workflow.studies.base""",
    "workflow.studies.scenes": "workflow workflow.studies.base workflow.studies.sounds",
    "workflow.studies.scene_spectra": """solver.files solver.response workflow
        workflow.studies.base workflow.studies.sounds""",
    "workflow.studies.recordings": "solver.response sound.clips workflow.studies.base",
    "workflow.studies.validation": """solver.files solver.refinement solver.response
        solver.studies workflow workflow.studies.base workflow.studies.report""",
    "workflow.studies.campaign": """workflow workflow.studies.base
        workflow.studies.validation""",
    "workflow.studies.comparison": "workflow workflow.studies.base",
    "workflow.commands": """dataset_gen.objectives solver.coarsening solver.correction
        solver.response
        solver.analysis workflow workflow.studies.base workflow.studies.comparison workflow.estimate
        workflow.studies.report workflow.studies.recordings""",
    "workflow.scripts": """solver.analysis sound.clips workflow.studies.base
        workflow.studies.campaign workflow.studies.report workflow.studies.comparison
        workflow.studies.sounds workflow.studies.recordings""",
}
"""Packages, from the bottom to the top, with those that they import beside `EVERYBODY`."""


@cache
def modules() -> dict[str, Path]:
    """Source files of all rooms by module name."""
    files = (path for room in ROOMS for path in (CHECKOUT / room).rglob("*.py"))
    return {_module_of(path): path for path in files}


def _module_of(path: Path) -> str:
    parts = path.relative_to(CHECKOUT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def package_of(module: str) -> str:
    """Package that a module lies in, or is."""
    return module if modules()[module].name == "__init__.py" else module.rpartition(".")[0]


def imported(module: str) -> Iterator[str]:
    """Modules of the project that a module imports, wherever in it."""
    for node in ast.walk(ast.parse(modules()[module].read_text())):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in modules() else node.module for name in whole]
        yield from (name for name in names if name in modules())


@cache
def arrows() -> dict[str, set[str]]:
    """Packages that each package imports."""
    found: dict[str, set[str]] = {}
    for module in modules():
        if not module.endswith(".__main__"):
            others = {package_of(name) for name in imported(module)}
            found.setdefault(package_of(module), set()).update(others)
    return {package: others - {package} for package, others in found.items()}


def test_every_package_has_its_arrows_listed():
    assert set(ARROWS) == set(arrows())


@pytest.mark.parametrize("package", ARROWS)
def test_packages_import_what_is_listed_and_nothing_else(package):
    listed = set(ARROWS[package].split())
    found = arrows()[package]
    if package not in EVERYBODY:
        found = found - set(EVERYBODY)
    assert found == listed


def test_no_arrow_points_back():
    order = list(TopologicalSorter(arrows()).static_order())
    assert set(order) == set(ARROWS)


@pytest.mark.parametrize("package", ARROWS)
def test_rooms_stand_in_one_chain(package):
    place = ROOMS.index(package.split(".")[0])
    assert {other.split(".")[0] for other in arrows()[package]} <= set(ROOMS[: place + 1])


def test_class_names_are_told_apart():
    named: dict[str, list[str]] = {}
    for name, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                named.setdefault(node.name, []).append(name)
    assert {name: where for name, where in named.items() if len(where) > 1} == {}


@pytest.mark.parametrize("library", ["petsc", "slepc"])
def test_petsc_and_slepc_are_had_from_one_module_each(library):
    """Which have them read no files of settings, and leave broken pipes to Python."""
    found = []
    for path in (*modules().values(), *(CHECKOUT / "tests").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module == f"{library}4py":
                found.append(_module_of(path))
    assert found == [f"carillon.{library}"]


@pytest.mark.parametrize("room", ROOMS[1:])
def test_rooms_begin_with_carillon(room):
    """Whose import has libraries, loaded later, read no settings in the present folder."""
    program = f"import sys, {room}; print('carillon.present_folder' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "True\n", done.stderr
