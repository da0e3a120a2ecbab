# The objectives compared by spectra, case by case: `snakemake objectives`, no part of the default run.


rule objectives:
    input:
        f"{STUDY}/report.html",


rule rate_objectives:
    input:
        mesh=case_mesh,
        forest=settings.studied_forest_files(config),
    output:
        f"{STUDY}/cases/{{solid}}/{{resolution}}-{{material}}.json",
    log:
        f"{LOGS}/objectives/{{solid}}/{{resolution}}-{{material}}.log",
    benchmark:
        f"{BENCHMARKS}/objectives/{{solid}}/{{resolution}}-{{material}}.tsv"
    threads: 1
    resources:
        mem_mb=growing(3000),
        runtime=growing(60),
    params:
        source=source("solver.commands.objectives"),
        case=case_arguments,
        modes=config["objectives"]["modes"],
        objectives=",".join(settings.studied_objectives(config)),
        forest=FOREST_ARGUMENT,
    shell:
        "OMP_NUM_THREADS={threads} python -m solver objectives {params.case:q} {params.forest:q}"
        " --modes {params.modes:q} --objectives {params.objectives:q} --out {output:q}"
        " > {log:q} 2>&1"


rule tabulate_objectives:
    input:
        config=f"{RESULTS}/config.yaml",
        cases=case_files,
    output:
        marks.tables(f"{STUDY}/tables", BUILDERS, "objectives"),
    log:
        f"{LOGS}/objectives/tables.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.tabulate_objectives"),
        goals=config["objectives"]["goals"],
    script:
        "../scripts/tabulate_objectives.py"


rule plot_objectives:
    input:
        config=f"{RESULTS}/config.yaml",
        errors=f"{STUDY}/tables/errors.json",
    output:
        svg=report(
            f"{STUDY}/figures/{{solid}}.svg",
            caption="../report/captions/objective_errors.rst",
            category="Figures",
            subcategory="objectives",
            labels={"figure": "Errors by objective, {solid}"},
        ),
        png=f"{STUDY}/figures/{{solid}}.png",
    log:
        f"{LOGS}/objectives/{{solid}}.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.plot_objectives"),
    script:
        "../scripts/plot_objectives.py"


rule build_objectives_report:
    input:
        config=f"{RESULTS}/config.yaml",
        tables=expand(f"{STUDY}/tables/{{table}}.json", table=list(BUILDERS)),
        figures=expand(f"{STUDY}/figures/{{solid}}.svg", solid=cases.solids_of(config)),
        templates=templates("study"),
    output:
        report(
            f"{STUDY}/report.html",
            caption="../report/captions/objectives.rst",
            category="Report",
            labels={"page": "Objectives of the coarsening"},
        ),
    log:
        f"{LOGS}/objectives/report.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.build_objectives_report"),
    script:
        "../scripts/build_objectives_report.py"
