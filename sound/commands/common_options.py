"""Options that several commands have in common."""

from carillon.parameters import option, parameters
from carillon.parameters.quantities import Count, Positive, Seed, Workers
from sound.project.settings import Dampings, OptimiserMethod


@parameters
class SearchOptions:
    """What takes the place of settings of a project's optimiser; None leaves one as it is."""

    seconds: Positive | None = option(None, "processor time of a search, not the project's")
    evaluations: Count | None = option(
        None, "modal analyses of a search at most, not the project's"
    )
    seed: Seed | None = option(None, "seed of the search, not the project's")
    method: OptimiserMethod | None = option(None, "not the project's")
    workers: Workers | None = option(None, "processes, not the project's")


@parameters
class DampingOptions:
    """Whose dampings sound."""

    damping_from: Dampings | None = option(
        None,
        "dampings of the clips, or those that loss factors of the material make, not as the "
        "project says",
    )
