# Pictures of the report: modes as they move, and an overview of each model.
from workflow.report import study as report_study


rule save_config:
    output:
        f"{RESULTS}/config.yaml",
    log:
        f"{LOGS}/config.log",
    localrule: True
    params:
        source=source("studies.base.scripts.write_yaml"),
        content=settings.resolved(config),
    script:
        "../../studies/base/scripts/write_yaml.py"


# Models that have the same variants, by what their pictures are drawn from.
for name, discretisation in {"draw_modes": "voxel", "draw_modes_of_cells": "finite-cell"}.items():
    drawn = {
        name: model
        for name, model in config["models"].items()
        if model["discretisation"] == discretisation
    }
    if drawn:

        rule:
            name:
                name
            input:
                config=f"{RESULTS}/config.yaml",
                surface=surface_files,
                modes=model_results(variants.shown_of, "models/{model}/{variant}.h5"),
            output:
                pictures=[
                    f"{RESULTS}/figures/{{model}}-mode-{variant}.png"
                    for variant in variants.shown_of(next(iter(drawn.values())))
                ],
                description=f"{RESULTS}/figures/{{model}}-mode.json",
            log:
                f"{LOGS}/figures/{{model}}-mode.log",
            wildcard_constraints:
                model="|".join(drawn),
            localrule: True
            params:
                source=source("workflow.scripts.draw_modes"),
            script:
                "../scripts/draw_modes.py"


# A picture for a README or a slide: one mode and the spectrum against the truth.
rule draw_overview:
    input:
        surface=surface_files,
        modes=model_results(variants.shown_of, "models/{model}/{variant}.h5"),
        frequencies=f"{RESULTS}/tables/frequencies.json",
        config=f"{RESULTS}/config.yaml",
    output:
        f"{RESULTS}/figures/{{model}}-overview.png",
    log:
        f"{LOGS}/figures/{{model}}-overview.log",
    localrule: True
    params:
        **made_by("plot", report_study.REPORT, "mode_pictures:overview_figure"),
        draw="mode_pictures:overview_figure",
    script:
        "../../studies/base/scripts/plot.py"
