"""What the study is made of."""

from studies.base.study import Config, Figure, Study
from workflow.arguments import options

THIN_WALLS = Study(
    name="thin_walls",
    title="Finite cells on thin curved walls",
    results="results:ThinWallStudy",
    tables=("walls", "thick", "summary", "levels", "bounds", "references", "provenance"),
    measured=lambda config: ["thin_walls.json", "bounds.json"],
    figures=(
        Figure("unknowns", "plots:unknowns_figure", "thin_walls.json"),
        Figure("seconds", "plots:seconds_figure", "thin_walls.json"),
        Figure("convergence", "plots:convergence_figure", "thin_walls.json"),
    ),
)


def solid_arguments(config: Config) -> list[str]:
    """Which solids are measured."""
    part = config["thin_walls"]
    files = [word for each in part["meshes"] for word in ("--mesh", each)]
    return ["--solids", ",".join(part["solids"]), *files]


def arguments(config: Config) -> list[str]:
    """What is measured of them."""
    part = config["thin_walls"]
    sizes = options({key: part[key] for key in ("resolution", "accuracy", "levels")})
    return solid_arguments(config) + sizes


def bound_arguments(config: Config) -> list[str]:
    """On which lattices frequencies below the references are sought."""
    part = config["thin_walls"]
    return solid_arguments(config) + options({"resolution": part["bounds_resolution"]})
