# What the studies are made from, and where they lie.
from workflow import solids
from workflow.studies import catalogue, marks
from workflow.studies.base.cases import cases_of
from workflow.studies.base.study import modules_of
from workflow.studies.campaign.cells import Cell, cells_of, validation_arguments

CASES = [config["objectives"], config["coarsening"], config["discretisation"], config["campaign"]]


wildcard_constraints:
    solid="|".join(sorted({solid for part in CASES for solid in part["models"]})),
    resolution=r"\d+",
    material="|".join(sorted({name for part in CASES for name in part["materials"]})),
    shape="|".join(config["figures"]["models"]),


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


def made_by(script, *references):
    """Fingerprint of what a script does for a study."""
    return source(f"workflow.scripts.{script}", *modules_of(*references))


def told(study, *names):
    """What a script has to know of a study."""
    return {name: getattr(study, name) for name in ("folder", "results", *names)}


def pages_of(study):
    """What a page is made by whose rule makes its tables as well."""
    return [study.results, study.page, *study.table_modules]


def descriptions(study):
    """Files that describe the tables of a study."""
    rooms = {entry.module.split(".")[0] for entry in study.entries.values()}
    files = [study.tables, "base/tables.yaml", *(f"{room}/tables.yaml" for room in sorted(rooms))]
    return [settings.FOLDER / "studies" / name for name in dict.fromkeys(files)]


def by_variant(names, pattern):
    """Files of all models by the variants that `names` tells of each."""
    return [
        file
        for name, model in config["models"].items()
        for file in expand(pattern, model=name, variant=names(model))
    ]


def measured_for(study):
    """Files that the tables of a study are made from."""
    folder = place(study)
    measured = [
        f"{folder}/models/{solid}/{file}.json"
        for file, where in solids.MEASURED.get(study.name, {}).items()
        for solid in solids.named(config, where)
    ]
    if study is catalogue.REPORT:
        modes = by_variant(variants.variants_of, "{model}/{variant}.h5")
        compared = expand("{model}/comparisons.json", model=MODELS)
        compared += [
            f"{name}/further_comparisons.json"
            for name, model in config["models"].items()
            if variants.further_of(model)
        ]
        return [
            f"{folder}/forests/forests.json",
            f"{folder}/forests/table.json",
            *(f"{folder}/dataset/{name}.json" for name in settings.own_shards(config)),
            *(f"{folder}/models/{file}" for file in modes + compared),
            *measured,
        ]
    if study is catalogue.FIGURES:
        return measured
    if study in (catalogue.OBJECTIVES, catalogue.COARSENING, catalogue.DISCRETISATION):
        return [f"{folder}/cases/{case.path}" for case in cases_of(config, study.name)]
    if study is catalogue.CAMPAIGN:
        return [f"{folder}/cells/{cell.path}.json" for cell in cells_of(config)]
    if study is catalogue.ACCURACY:
        return [f"{folder}/accuracy.json"]
    parts = ("model", "blocks", "benchmark", "variants", "curve")
    return [f"{folder}/{part}.json" for part in parts]


def shown_beside(study):
    """What a page shows beside its tables and figures."""
    if study is catalogue.COARSENING:
        cases = cases_of(config, study.name)
        return [f"{place(study)}/cases/{case.path}".replace(".json", ".h5") for case in cases]
    if study is not catalogue.REPORT:
        return []
    modes = by_variant(variants.shown_of, "{model}-mode-{variant}.png")
    return [
        *(f"{RESULTS}/figures/{name}" for name in modes),
        *(f"{RESULTS}/figures/{model}-mode.json" for model in MODELS),
        *(f"{RESULTS}/validation/tables/{model}-criteria.json" for model in MODELS),
    ]


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


def objectives_arguments():
    """What is compared in every case."""
    part = config["objectives"]
    how = {
        "forest": part["forest"] and path_word(part["forest"]),
        "modes": part["modes"],
        "objectives": ",".join(settings.studied_objectives(config)),
    }
    return options(how)


def coarsening_arguments():
    """How every case is coarsened and refined."""
    part = config["coarsening"]
    how = {
        "forest": part["forest"] and path_word(part["forest"]),
        "modes": part["modes"],
        "refine_to": part["refine_to"],
    }
    return options(how)


def discretisation_arguments():
    """What is compared in every case, and how often it is timed."""
    part = config["discretisation"]
    how = {
        "forest": part["forest"] and path_word(part["forest"]),
        "modes": part["modes"],
        "runs": part["runs"],
    }
    return options(how)


def accuracy_arguments():
    """What is measured, and how often."""
    part = config["accuracy"]
    how = {
        "solids": ",".join(part["solids"]),
        "levels": part["levels"],
        "runs": part["runs"],
    }
    return options(how)


def shape_mesh(wildcards):
    """Mesh file of a solid of the figures; none for a built-in object."""
    return solids.mesh_files(config, "figures", wildcards.shape)


def shape_arguments(wildcards):
    """What the solid of a figure is: mesh, resolution, material."""
    model = config["figures"]["models"][wildcards.shape]
    how = {key: model[key] for key in ("resolution", "material", "components")}
    mesh = settings.mesh_of(config, wildcards.shape, "figures")
    return [mesh, *options(how | {"poisson": config["poisson"]})]


def require_baseline(wildcards):
    """No files: they may be those of the rule `reference`, which must not be made anew for this."""
    if not config["baseline"]:
        raise WorkflowError("baseline: names no folder, run with --config baseline=FOLDER")
    return []
