# Every study that is made in steps: results -> tables -> figures -> page.


for study in catalogue.in_steps():

    rule:
        name:
            f"tabulate_{study.name}"
        input:
            config=f"{RESULTS}/config.yaml",
            found=below(study, study.measured(config)),
            described=descriptions(study.package, study.tables),
        output:
            expand(
                f"{place(study)}/tables/{{name}}.{{kind}}",
                name=study.entries,
                kind=("csv", "md", "json"),
            ),
        log:
            f"{logs_of(study)}/tables.log",
        localrule: True
        params:
            source=source(
                "studies.base.scripts.tabulate", study.module(study.results), *study.table_modules
            ),
            study=described(study, "tables"),
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
                source=made_by("plot", study, study.results, figure.draw),
                study=described(study),
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
            templates=templates(study),
        output:
            f"{place(study)}/report.html",
        log:
            f"{logs_of(study)}/report.log",
        localrule: True
        params:
            source=made_by("page", study, study.results, study.page),
            study=described(study, "page"),
        script:
            "scripts/page.py"
