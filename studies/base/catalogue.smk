# Where the studies lie, and what their tables and pages are made from.
from studies.base import catalogue
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
    """Folder of a study's logs; those of the report are not apart."""
    return str(Path(LOGS, study.folder or study.name.removesuffix("report")))


def tables_in(study, *names, kinds=("json",)):
    """Files of tables of a study, of all unless some are named, beside its page."""
    folder = Path(place(study), study.file).parent / "tables"
    names = [study.prefix + name for name in names or study.tables]
    return [f"{folder}/{name}.{kind}" for name in names for kind in kinds]


def figures_of(study):
    """SVG files of all figures of a study that are drawn."""
    names = [name for figure in study.figures for name in figure.files(config)]
    return [f"{place(study)}/figures/{name}.svg" for name in names]


def below(study, names):
    """Files of a study by their names below its folder."""
    return [os.path.normpath(Path(place(study), name)) for name in names]


def made_by(script, study, *references):
    """Parameters of a study's script: the fingerprint of what it does, and the study.

    The script does it with what is named `MODULE:NAME`.
    """
    modules = [study.module(each) for each in (study.results, *references)]
    return {"source": source(f"studies.base.scripts.{script}", *modules), "study": study.name}


def made_with_tables(study):
    """The same of a page whose rule makes its tables as well."""
    return made_by("page", study, study.page, study.tabulated)


def meshes_of(section):
    """Mesh files of the solid of a case of a study."""
    return lambda wildcards: solids.mesh_files(config, section, wildcards.solid)


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
