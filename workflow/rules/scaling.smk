# Wall time over MPI ranks, in the report of the run: a small solid on few ranks. More of both are
# part of target figures.


use rule measure_scaling as measure_scaling_of_run with:
    input:
        model_files,
    output:
        f"{RESULTS}/models/{{model}}/scaling.json",
    log:
        f"{LOGS}/models/{{model}}/scaling.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/scaling.tsv"
    params:
        source=source("solver.commands.scaling"),
        model=lambda wildcards: model_arguments(wildcards, config["scaling"]["resolution"]),
        how=scaling_arguments(config["scaling"]),
