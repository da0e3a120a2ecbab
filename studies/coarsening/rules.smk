# Coarse models mode by mode, case by case: `snakemake coarsening`, no part of the default run.
from studies.coarsening import study as coarsening_study


rule coarsening:
    input:
        f"{place(coarsening_study.COARSENING)}/report.html",


rule rate_coarsening:
    input:
        mesh=lambda wildcards: solids.mesh_files(config, "coarsening", wildcards.solid),
        forest=settings.forest_files(config["coarsening"]["forest"]),
    output:
        case=f"{place(coarsening_study.COARSENING)}/cases/{{solid}}/{{resolution}}-{{material}}.json",
        pictures=f"{place(coarsening_study.COARSENING)}/cases/{{solid}}/{{resolution}}-{{material}}.h5",
    log:
        f"{LOGS}/coarsening/{{solid}}/{{resolution}}-{{material}}.log",
    benchmark:
        f"{BENCHMARKS}/coarsening/{{solid}}/{{resolution}}-{{material}}.tsv"
    resources:
        **limits("rate_coarsening"),
    params:
        source=source("studies.coarsening.command"),
        case=case_arguments("coarsening"),
        how=coarsening_study.arguments(config),
    shell:
        "python -m solver coarsening {params.case:q} {params.how:q}"
        " --out {output.case:q} --pictures {output.pictures:q} > {log:q} 2>&1"
