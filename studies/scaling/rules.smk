# Wall time over MPI ranks, in the report of the run: a small solid on few ranks. More of both are
# part of target figures.
from studies.scaling import config as scaling


# It starts the ranks itself, one thread each.
rule measure_scaling_of_run:
    input:
        model_files,
    output:
        f"{RESULTS}/models/{{model}}/scaling.json",
    log:
        f"{LOGS}/models/{{model}}/scaling.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/scaling.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("measure_scaling"),
    params:
        source=source("studies.scaling.command"),
        model=lambda wildcards: model_arguments(wildcards, config["scaling"]["resolution"]),
        how=scaling.arguments(config["scaling"]),
    shell:
        "python -m carillon study scaling {params.model:q} {params.how:q} --out {output:q} > {log:q} 2>&1"
