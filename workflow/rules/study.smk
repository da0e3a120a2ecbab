# From a case of the objectives' study to the solver's arguments.
from workflow.study import cases
from workflow.study.tables import BUILDERS

STUDY = f"{RESULTS}/objectives"
FOREST_ARGUMENT = options({"forest": settings.named_forest(config)})


wildcard_constraints:
    solid="|".join(config["objectives"]["models"]),
    resolution=r"\d+",
    material="|".join(config["objectives"]["materials"]),


def case_files(wildcards):
    """Results of all cases whose mesh exists."""
    return [f"{STUDY}/cases/{case.path}" for case in cases.cases_of(config)]


def case_mesh(wildcards):
    """Mesh file of a case; none for a built-in object."""
    mesh = settings.studied_mesh(config, wildcards.solid)
    return [] if mesh.startswith(settings.BUILTIN) else [mesh]


def case_arguments(wildcards):
    """What the solid is: mesh, resolution, material."""
    model = config["objectives"]["models"][wildcards.solid]
    how = {
        "resolution": wildcards.resolution,
        "material": wildcards.material,
        "poisson": config["poisson"],
        "components": model["components"],
    }
    return [settings.studied_mesh(config, wildcards.solid), *options(how)]
