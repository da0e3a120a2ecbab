# Ways to a spectrum compared, case by case: `snakemake discretisation`, no part of the default run.
from studies.discretisation import study as discretisation_study


rule discretisation:
    input:
        f"{place(discretisation_study.DISCRETISATION)}/report.html",


rule rate_discretisation:
    input:
        mesh=lambda wildcards: solids.mesh_files(config, "discretisation", wildcards.solid),
        forest=settings.forest_files(config["discretisation"]["forest"]),
    output:
        f"{place(discretisation_study.DISCRETISATION)}/cases/{{solid}}/{{resolution}}-{{material}}.json",
    log:
        f"{LOGS}/discretisation/{{solid}}/{{resolution}}-{{material}}.log",
    benchmark:
        f"{BENCHMARKS}/discretisation/{{solid}}/{{resolution}}-{{material}}.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("rate_discretisation"),
    params:
        source=source("studies.discretisation.command"),
        case=case_arguments("discretisation"),
        how=discretisation_study.arguments(config),
    shell:
        "python -m solver discretisation {params.case:q} {params.how:q}"
        " --out {output:q} > {log:q} 2>&1"
