# Every study: results -> tables -> figures -> page.


rule save_config:
    output:
        f"{RESULTS}/config.yaml",
    log:
        f"{LOGS}/config.log",
    localrule: True
    params:
        source=source("workflow.scripts.write_yaml"),
        content=settings.resolved(config),
    script:
        "../scripts/write_yaml.py"


for study in catalogue.STUDIES:

    rule:
        name:
            f"tabulate_{study.name}"
        input:
            config=f"{RESULTS}/config.yaml",
            found=measured_for(study),
            described=descriptions(study),
        output:
            marks.tables(study, place(study)),
        log:
            f"{logs_of(study)}/tables.log",
        localrule: True
        params:
            source=made_by("tabulate", study.results, *study.table_modules),
            study=told(study, "tables"),
        script:
            "../scripts/tabulate.py"

    for figure in study.figures:

        rule:
            name:
                f"plot_{figure.name}"
                if study is catalogue.REPORT
                else f"plot_{study.name}_{figure.name}"
            input:
                config=f"{RESULTS}/config.yaml",
                found=f"{place(study)}/{figure.needs}",
            output:
                marks.figure(study, figure, place(study)),
            log:
                f"{logs_of(study)}/figures/{figure.file}.log",
            localrule: True
            params:
                source=made_by("plot", study.results, figure.draw),
                study=told(study),
                draw=figure.draw,
            script:
                "../scripts/plot.py"

    rule:
        name:
            f"build_{study.name}"
        input:
            config=f"{RESULTS}/config.yaml",
            tables=tables_in(study),
            figures=figures_of(study),
            others=shown_beside(study),
            templates=templates(study.room),
        output:
            marks.page(study, f"{place(study)}/report.html"),
        log:
            f"{logs_of(study)}/report.log",
        localrule: True
        params:
            source=made_by("page", study.results, study.page),
            study=told(study, "page"),
        script:
            "../scripts/page.py"


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
                    report(
                        f"{RESULTS}/figures/{{model}}-mode-{variant}.png",
                        caption="../studies/captions/mode.rst",
                        category="Figures",
                        subcategory="{model}",
                        labels={
                            "figure": f"First elastic mode, {variants.VARIANTS[variant].label}"
                        },
                    )
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
        report(
            f"{RESULTS}/figures/{{model}}-overview.png",
            caption="../studies/captions/overview.rst",
            category="Figures",
            subcategory="{model}",
            labels={"figure": "Mode and spectrum"},
        ),
    log:
        f"{LOGS}/figures/{{model}}-overview.log",
    localrule: True
    params:
        source=made_by("plot", "report.overview:overview_figure"),
        study=told(catalogue.REPORT),
        draw="report.overview:overview_figure",
    script:
        "../scripts/plot.py"
