# Ways to a spectrum compared, case by case: `snakemake discretisation`, no part of the default run.


rule discretisation:
    input:
        f"{place(catalogue.DISCRETISATION)}/report.html",


rule rate_discretisation:
    input:
        mesh=lambda wildcards: solids.mesh_files(config, "discretisation", wildcards.solid),
        forest=settings.forest_files(config["discretisation"]["forest"]),
    output:
        f"{place(catalogue.DISCRETISATION)}/cases/{{solid}}/{{resolution}}-{{material}}.json",
    log:
        f"{LOGS}/discretisation/{{solid}}/{{resolution}}-{{material}}.log",
    benchmark:
        f"{BENCHMARKS}/discretisation/{{solid}}/{{resolution}}-{{material}}.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("rate_discretisation"),
    params:
        source=source("solver.commands.discretisation"),
        case=case_arguments("discretisation"),
        how=discretisation_arguments(),
    shell:
        "python -m solver discretisation {params.case:q} {params.how:q}"
        " --out {output:q} > {log:q} 2>&1"
