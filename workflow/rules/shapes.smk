# From a solid of the figures to the solver's arguments.
from workflow.figures.results import FOLDER as FIGURES_FOLDER
from workflow.figures.results import present
from workflow.figures.tables import BUILDERS as FIGURE_TABLES

FIGURES = f"{RESULTS}/{FIGURES_FOLDER}"


wildcard_constraints:
    shape="|".join(config["figures"]["models"]),


def shape_mesh(wildcards):
    """Mesh file of a solid; none for a built-in object."""
    mesh = settings.figured_mesh(config, wildcards.shape)
    return [] if mesh.startswith(settings.BUILTIN) else [mesh]


def shape_arguments(wildcards):
    """What the solid is: mesh, resolution, material."""
    model = config["figures"]["models"][wildcards.shape]
    how = {key: model[key] for key in ("resolution", "material", "components")}
    return [
        settings.figured_mesh(config, wildcards.shape),
        *options(how | {"poisson": config["poisson"]}),
    ]


def shape_results(file, part="models"):
    """Result files of all solids of a part of the figures."""
    return expand(f"{FIGURES}/models/{{shape}}/{file}.json", shape=present(config, part))
