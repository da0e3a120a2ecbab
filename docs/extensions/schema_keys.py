"""Keys of the configuration, of projects and of scenes as lists; their materials as a table."""

from itertools import takewhile

import parameter_tables

from carillon.composition.materials import MATERIALS, named_material
from sound.project.project import Project
from sound.scenes.scene import Scene
from workflow import settings
from workflow.configuration.whole import limits, whole

_HEAD = (
    "| name | E [GPa] | ν | density [kg/m³] | α [1/s] | β [s] | bounce | friction "
    "| roughness [µm] | source |"
)


def of_configuration() -> str:
    """Sections with the keys of the configuration."""
    return parameter_tables.sections(whole(), "The run") + _limits_of_rules()


def _limits_of_rules() -> str:
    rows = [
        f"| `{rule}` | {each.what} | {each.memory_mb or ''} | {each.minutes} |"
        for rule, each in limits().items()
    ]
    head = ["", "| rule | a job makes | memory [MB] | time [min] |", "| --- | --- | --: | --: |"]
    return "\n".join([*head, *rows, ""])


def of_presets() -> str:
    """A line for each preset: its name and the first sentence in its file."""
    lines = []
    for path in sorted((settings.FOLDER / "config").glob("*.yaml")):
        head = takewhile(lambda line: line.startswith("#"), path.read_text().splitlines())
        sentence = " ".join(line.lstrip("# ") for line in head).partition(". ")[0].rstrip(".")
        lines.append(f"- `{path.stem}`: {sentence}.")
    return "\n".join(lines) + "\n"


def of_project() -> str:
    """Sections with the keys of a project."""
    return parameter_tables.sections(Project, "The solid")


def of_scene() -> str:
    """Sections with the keys of a scene."""
    return parameter_tables.sections(Scene, "The scene")


def of_materials() -> str:
    """A line for each material."""
    rows = [_HEAD, "| --- |" + " ---: |" * 8 + " --- |"]
    for name in MATERIALS:
        each = named_material(name)
        numbers = [
            f"{each.young / 1e9:.3g}",
            f"{each.poisson:.3g}",
            f"{each.density:.4g}",
            f"{each.alpha:.3g}",
            f"{each.beta:.2g}",
            f"{each.restitution:.2g}",
            f"{each.friction:.2g}",
            f"{1e6 * each.roughness:.2g}",
        ]
        rows.append(f"| {name} | {' | '.join(numbers)} | {each.about}. {each.source} |")
    return "\n".join(rows) + "\n"
