"""What the study is made of."""

from studies.base.study import Config, Figure, Study
from workflow import settings, solids
from workflow.arguments import options

MEASURES = {
    "methods": "figures.models",
    "convergence": "figures.convergence",
    "scaling": "figures.scaling",
}
"""Keys of the configuration that name the measured solids, by the file of the result."""

FIGURES = Study(
    name="figures",
    folder="paper",
    title="Times, convergence and scaling in full",
    results="page:Figures",
    tables=("convergence", "methods", "ratios", "spreads", "scaling", "provenance"),
    measured=lambda config: solids.measured_files(config, MEASURES),
    figures=(
        Figure("times", "workflow.report.plots:methods_figure", "tables/methods.json"),
        Figure(
            "{shape}-convergence",
            "workflow.report.convergence_plot:convergence_figure",
            "models/{shape}/convergence.json",
            of="figures.convergence",
        ),
        Figure(
            "{shape}-scaling",
            "studies.scaling.plot:scaling_figure",
            "models/{shape}/scaling.json",
            of="figures.scaling",
        ),
    ),
)


def arguments(config: Config, shape: str) -> list[str]:
    """What the solid of a figure is: mesh, resolution, material."""
    model = config["figures"]["models"][shape]
    how = {key: model[key] for key in ("resolution", "material", "components")}
    mesh = settings.mesh_of(config, shape, "figures")
    return [mesh, *options(how | {"poisson": config["poisson"]})]
