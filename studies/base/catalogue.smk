# Where the studies lie, and what their tables and pages are made from.
from studies.base import catalogue
from studies.base.cases import cases_of
from studies.base.entry import descriptions
from workflow import solids

ALL_STUDIES = catalogue.all_studies()
CASES = [
    part
    for part in config.values()
    if isinstance(part, dict) and "materials" in part and "models" in part
]


wildcard_constraints:
    solid="|".join(sorted({solid for part in CASES for solid in part["models"]})),
    resolution=r"\d+",
    material="|".join(sorted({name for part in CASES for name in part["materials"]})),


def place(study):
    """Folder of a study."""
    return str(Path(RESULTS, study.folder))


def logs_of(study):
    """Folder of a study's logs."""
    return str(Path(LOGS, study.folder))


def tables_in(study):
    """JSON files of a study's tables."""
    return [f"{place(study)}/tables/{name}.json" for name in study.entries]


def figures_of(study):
    """SVG files of all figures of a study that are drawn."""
    names = [name for figure in study.figures for name in figure.files(config)]
    return [f"{place(study)}/figures/{name}.svg" for name in names]


def below(study, names):
    """Files of a study by their names below its folder."""
    return [str(Path(place(study), name)) for name in names]


def made_by(script, study, *references):
    """Fingerprint of what a script does for a study with what is named `MODULE:NAME`."""
    modules = [study.module(each) for each in references]
    return source(f"studies.base.scripts.{script}", *modules)


def made_with_tables(study):
    """Fingerprint of a page whose rule makes its tables as well."""
    modules = [study.module(each) for each in (study.results, study.page)]
    return source("studies.base.scripts.page", *modules, *study.table_modules)


def described(study, *names):
    """What a script has to know of a study."""
    return {name: getattr(study, name) for name in ("package", "folder", "results", *names)}


def templates(study, *names):
    """Templates of a study's page: its own, and what all pages share."""
    base = Path(catalogue.__file__).parent
    own = base.parent.parent.joinpath(*study.package.split("."))
    shared = ("base.html.j2", "macros.html.j2", "page.css")
    return [*(own / name for name in names or ["page.html.j2"]), *(base / name for name in shared)]


def case_arguments(section):
    """What the solid of a case of a study is: mesh, resolution, material."""

    def arguments(wildcards):
        how = {
            "resolution": wildcards.resolution,
            "material": wildcards.material,
            "poisson": config["poisson"],
            "components": config[section]["models"][wildcards.solid]["components"],
        }
        return [settings.mesh_of(config, wildcards.solid, section), *options(how)]

    return arguments
