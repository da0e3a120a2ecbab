# Every study: the target of its name, none of which is part of the default run, and what is the
# same for all that are made in steps: results -> tables -> figures -> page.


for study in catalogue.all_studies().values():
    if study.target and "{" not in study.file:

        rule:
            name:
                study.name
            input:
                f"{place(study)}/{study.file}",


for study in catalogue.of_cases():

    rule:
        name:
            f"rate_{study.name}"
        input:
            mesh=meshes_of(study.name),
            forest=settings.forest_files(config[study.name]["forest"]),
        output:
            **{
                option: f"{place(study)}/cases/{{solid}}/{{resolution}}-{{material}}{ending}"
                for option, ending in study.outputs
            },
        log:
            f"{logs_of(study)}/{{solid}}/{{resolution}}-{{material}}.log",
        benchmark:
            f"{BENCHMARKS}/{study.name}/{{solid}}/{{resolution}}-{{material}}.tsv"
        threads: SOLVER_CORES if study.timed else 1
        resources:
            **limits(f"rate_{study.name}"),
        params:
            source=source(f"studies.{study.name}.command"),
            study=study.name,
            case=case_arguments(study.name),
            how=study.arguments(config),
            outputs=lambda wildcards, output: options(dict(output.items())),
        shell:
            "python -m carillon study {params.study:q} {params.case:q} {params.how:q}"
            " {params.outputs:q} > {log:q} 2>&1"


for study in catalogue.in_steps():

    rule:
        name:
            f"tabulate_{study.name}"
        input:
            config=f"{RESULTS}/config.yaml",
            found=below(study, study.measured(config)),
        output:
            tables_in(study, kinds=("csv", "md", "json")),
        log:
            f"{logs_of(study)}/tables.log",
        localrule: True
        params:
            **made_by("tabulate", study, study.tabulated),
        script:
            "scripts/tabulate.py"

    for figure in study.figures:

        rule:
            name:
                f"plot_{figure.name}"
                if study.name == "report"
                else f"plot_{study.name}_{figure.name}"
            input:
                config=f"{RESULTS}/config.yaml",
                found=f"{place(study)}/{figure.needs}",
            output:
                expand(
                    f"{place(study)}/figures/{figure.file}.{{kind}}",
                    kind=("svg", "png"),
                    allow_missing=True,
                ),
            log:
                f"{logs_of(study)}/figures/{figure.file}.log",
            localrule: True
            params:
                **made_by("plot", study, figure.draw),
                draw=figure.draw,
            script:
                "scripts/plot.py"

    rule:
        name:
            f"build_{study.name}"
        input:
            config=f"{RESULTS}/config.yaml",
            tables=tables_in(study),
            figures=figures_of(study),
            others=below(study, study.beside(config)),
        output:
            f"{place(study)}/{study.file}",
        log:
            f"{logs_of(study)}/report.log",
        localrule: True
        params:
            **made_by("page", study, study.page),
        script:
            "scripts/page.py"
