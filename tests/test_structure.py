"""Which package may import which: every arrow is listed, and none points back."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import studies
from carillon.errors import UserError
from tests.programs import CHECKOUT, python

ROOMS = ("carillon", "dataset_gen", "forests", "solver", "sound", "studio", "workflow", "studies")

SURFACE = "carillon.api"
"""What users import; it names things as they do."""

EVERYBODY = (
    "carillon",
    "carillon.command_line",
    "carillon.files",
    "carillon.parameters",
    "carillon.records",
    "carillon.processes",
    "carillon.numerics",
    "carillon.fem",
    "carillon.fem.geometry",
    "carillon.fem.finite_cells",
    "carillon.composition",
    "carillon.drawing",
    "carillon.notebook",
)
"""Packages that all others may import."""

ARROWS = {
    "carillon": "",
    "carillon.numerics": "",
    "carillon.files": "carillon",
    "carillon.processes": "carillon carillon.files",
    "carillon.records": "carillon carillon.numerics carillon.processes",
    "carillon.parameters": "carillon carillon.files carillon.processes",
    "carillon.command_line": """carillon carillon.files carillon.parameters carillon.processes
        carillon.records""",
    "carillon.fem.geometry": "carillon carillon.command_line carillon.files carillon.parameters",
    "carillon.drawing": "carillon carillon.fem.geometry carillon.files",
    "carillon.notebook": "carillon carillon.drawing carillon.fem.geometry",
    "carillon.fem": """carillon carillon.fem.geometry carillon.files carillon.notebook
        carillon.processes""",
    "carillon.fem.finite_cells": "carillon carillon.fem carillon.fem.geometry",
    "carillon.composition": """carillon carillon.fem carillon.fem.finite_cells carillon.fem.geometry
        carillon.files carillon.parameters""",
    #
    "dataset_gen.objectives": "",
    "dataset_gen": "dataset_gen.objectives",
    "dataset_gen.commands": "dataset_gen dataset_gen.objectives",
    #
    "forests": "dataset_gen.objectives",
    "forests.training": "dataset_gen dataset_gen.objectives forests",
    "forests.commands": "forests forests.training",
    #
    "solver.distribution": "",
    "solver.coarsening": "dataset_gen.objectives forests",
    "solver.assembly": "solver.distribution",
    "solver.files": "solver.distribution",
    "solver.subspace": "solver.assembly solver.distribution",
    "solver.linear": "solver.assembly solver.distribution",
    "solver.response": "solver.files solver.subspace",
    "solver.reference": "solver.assembly solver.linear solver.subspace",
    "solver.correction": "solver.assembly solver.distribution solver.linear solver.subspace",
    "solver.hcms": "solver.assembly solver.distribution solver.linear solver.subspace",
    "solver.verification": """solver.assembly solver.correction solver.distribution solver.files
        solver.linear solver.reference solver.response solver.subspace""",
    "solver.analysis": """dataset_gen.objectives solver.assembly solver.coarsening
        solver.correction solver.distribution solver.files solver.hcms solver.linear
        solver.reference solver.subspace solver.verification""",
    "solver": "solver.analysis",
    "solver.refinement": """solver.analysis solver.assembly solver.coarsening solver.correction
        solver.distribution solver.files solver.linear solver.subspace""",
    "solver.exchange": "solver.assembly solver.files solver.refinement solver.response",
    "solver.accuracy": "solver.analysis solver.distribution solver.files solver.refinement",
    "solver.commands": """solver.accuracy solver.analysis solver.coarsening solver.correction
        solver.distribution solver.exchange solver.files solver.linear solver.refinement
        solver.response solver.verification""",
    #
    "sound": "solver.response",
    "sound.heads": "",
    "sound.synthesis": "solver.response",
    "sound.clips": "sound sound.synthesis",
    "sound.project": """solver.analysis solver.coarsening solver.files sound sound.clips
        sound.radiation""",
    "sound.design": """solver.analysis solver.coarsening solver.distribution solver.files
        solver.linear solver.response solver.subspace sound sound.clips sound.project
        sound.radiation""",
    "sound.rendering": """solver.files solver.response solver.subspace sound sound.clips
        sound.design sound.project sound.synthesis""",
    "sound.radiation": "solver.response sound",
    "sound.building": """solver.analysis solver.files solver.response sound sound.design
        sound.project sound.rendering""",
    "sound.scenes": """solver.accuracy solver.analysis solver.files solver.refinement
        solver.response sound sound.project sound.rendering""",
    "sound.scenes.film": "sound sound.scenes",
    "sound.scenes.contact": "sound.scenes",
    "sound.export": """solver.assembly solver.files solver.response solver.verification
        sound sound.clips sound.design sound.project sound.rendering sound.scenes""",
    "sound.scenes.audible": """sound.heads sound.radiation sound.rendering
        sound.scenes sound.scenes.contact sound.synthesis""",
    "sound.commands": """solver.response sound sound.building sound.clips sound.design sound.export
        sound.heads sound.project sound.rendering""",
    "sound.scenes.playing": """sound sound.clips sound.heads sound.radiation sound.scenes
        sound.scenes.audible sound.scenes.contact sound.synthesis""",
    #
    "studio": "",
    "studio.server": "sound.project studio",
    "studio.standalone": "solver.response sound.design sound.project sound.rendering studio",
    "studio.scene": "sound sound.scenes studio studio.standalone",
    "studio.processes": """solver.analysis solver.files solver.response sound sound.clips
        sound.design sound.export sound.heads sound.project sound.rendering sound.synthesis
        studio studio.standalone""",
    "studio.session": "sound sound.clips sound.heads sound.project studio studio.processes",
    "studio.commands": """sound sound.clips sound.export sound.project
        sound.scenes sound.scenes.film sound.scenes.playing studio.scene studio.server
        studio.session studio.standalone""",
    #
    "workflow.configuration": "dataset_gen dataset_gen.objectives",
    "workflow": "forests workflow.configuration",
    "workflow.crate": "forests workflow",
    "workflow.estimate": "solver workflow",
    "workflow.report": "solver.files solver.hcms solver.refinement workflow studies.base",
    "workflow.scripts": "workflow.report studies.base",
    "workflow.validation": """solver.files solver.refinement solver.response solver.verification
        workflow workflow.report studies.base""",
    "workflow.commands": """dataset_gen.objectives solver.analysis solver.coarsening
        solver.correction solver.response workflow workflow.configuration workflow.crate
        workflow.estimate workflow.report studies.base""",
    #
    "studies": "",
    "studies.base": "solver.response workflow studies",
    "studies.base.scripts": "studies.base",
}
"""Packages, from the bottom to the top, with those that they import beside `EVERYBODY`."""


@cache
def modules() -> dict[str, Path]:
    """Source files of all rooms by module name."""
    files = [path for room in ROOMS for path in (CHECKOUT / room).rglob("*.py")]
    return {_module_of(path): path for path in files if not path.name.startswith("test_")}


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


def study_of(module: str) -> str | None:
    """Name of the study that a module belongs to; what all studies share belongs to none."""
    room, _, rest = module.partition(".")
    name = rest.partition(".")[0]
    return name if room == "studies" and name not in ("", "base") else None


@cache
def arrows() -> dict[str, set[str]]:
    """Packages that each package imports; studies are told apart by `study_of`.

    `carillon` itself prepares the process before anything is loaded, so it is left out, and the
    public surface is where all comes together.
    """
    found: dict[str, set[str]] = {}
    for module in modules():
        apart = module in ("carillon", SURFACE) or module.endswith(".__main__")
        if not apart and not study_of(module):
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


PLACES = (
    *ROOMS[:-2],
    "workflow",
    "studies",
    "studies.base",
    "workflow.report",
    "workflow.validation",
)
"""The chain of rooms; the report is made as studies are, and imports what these share."""


def _place(package: str) -> int:
    """Number of the last place in the chain that a package belongs to."""
    return max(k for k, each in enumerate(PLACES) if f"{package}.".startswith(f"{each}."))


@pytest.mark.parametrize("package", ARROWS)
def test_rooms_stand_in_one_chain(package):
    """But for commands and scripts, which are where all comes together."""
    if package in ("studies", "workflow.commands", "workflow.scripts"):
        return
    assert all(_place(other) <= _place(package) for other in arrows()[package])


@pytest.mark.parametrize("study", studies.names())
def test_a_study_imports_the_product_and_those_studies_that_it_needs(study):
    needs = getattr(import_module(f"studies.{study}"), "NEEDS", ())
    own = [module for module in modules() if study_of(module) == study]
    others = {study_of(name) for module in own for name in imported(module)}
    assert others <= {None, study, *needs}
    rules = Path(studies.__file__).with_name(study) / "rules.smk"
    sources = rules.read_text() if rules.is_file() else ""
    assert set(re.findall(r"\bstudies\.(\w+)", sources)) <= {"FOLDER", "base", study, *needs}


def test_a_study_that_is_needed_and_missing_is_named(monkeypatch):
    kept = [name for name in studies.names() if name != "recordings"]
    monkeypatch.setattr(studies, "names", lambda: kept)
    with pytest.raises(UserError, match="no folder studies/recordings, which studies/sounds needs"):
        studies.rules()
    monkeypatch.setattr(studies, "names", lambda: [name for name in kept if name != "blocks"])
    with pytest.raises(UserError, match="no folder studies/blocks, which workflow/report needs"):
        studies.rules()


def test_commands_of_studies_have_names_of_their_own():
    modules = [import_module(f"studies.{study}") for study in studies.names()]
    named = [
        name
        for module in modules
        for name in [*getattr(module, "COMMANDS", ()), *getattr(module, "PAGES", ())]
    ]
    assert sorted(named) == sorted(studies.commands())


def test_nothing_of_the_product_imports_a_study():
    found = {
        (module, name)
        for module in modules()
        if study_of(module) is None
        for name in imported(module)
        if study_of(name)
    }
    assert found == set()


def test_nothing_imports_the_public_surface():
    assert [name for name in modules() if SURFACE in imported(name)] == ["carillon"]


def test_public_class_names_are_told_apart():
    named: dict[str, list[str]] = {}
    for name, path in modules().items():
        if name == SURFACE:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
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
    assert found == [f"carillon.processes.{library}"]


@pytest.mark.parametrize("room", ROOMS[1:])
def test_rooms_begin_with_carillon(room):
    """Whose import has libraries, loaded later, read no settings in the present folder."""
    program = f"import sys, {room}; print('carillon.processes.present_folder' in sys.modules)"
    done = python("-c", program)
    assert done.stdout == "True\n", done.stderr
