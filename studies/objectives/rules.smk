# The objectives compared by spectra, case by case: `snakemake objectives`, no part of the default run.
from studies.objectives import study as objectives_study


rule objectives:
    input:
        f"{place(objectives_study.OBJECTIVES)}/report.html",


rule rate_objectives:
    input:
        mesh=lambda wildcards: solids.mesh_files(config, "objectives", wildcards.solid),
        forest=settings.forest_files(config["objectives"]["forest"]),
    output:
        f"{place(objectives_study.OBJECTIVES)}/cases/{{solid}}/{{resolution}}-{{material}}.json",
    log:
        f"{LOGS}/objectives/{{solid}}/{{resolution}}-{{material}}.log",
    benchmark:
        f"{BENCHMARKS}/objectives/{{solid}}/{{resolution}}-{{material}}.tsv"
    resources:
        **limits("rate_objectives"),
    params:
        source=source("studies.objectives.command"),
        case=case_arguments("objectives"),
        how=objectives_study.arguments(config),
    shell:
        "python -m solver objectives {params.case:q} {params.how:q} --out {output:q} > {log:q} 2>&1"
