# The objectives compared by spectra, case by case: `snakemake objectives`, no part of the default run.


rule objectives:
    input:
        f"{place(catalogue.OBJECTIVES)}/report.html",


rule rate_objectives:
    input:
        mesh=lambda wildcards: solids.mesh_files(config, "objectives", wildcards.solid),
        forest=settings.studied_forest_files(config),
    output:
        f"{place(catalogue.OBJECTIVES)}/cases/{{solid}}/{{resolution}}-{{material}}.json",
    log:
        f"{LOGS}/objectives/{{solid}}/{{resolution}}-{{material}}.log",
    benchmark:
        f"{BENCHMARKS}/objectives/{{solid}}/{{resolution}}-{{material}}.tsv"
    threads: 1
    resources:
        **limits("rate_objectives"),
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
