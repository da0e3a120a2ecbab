# Wall times of every way to a spectrum, in the report of the run.
from studies.benchmark import config as timing


# Methods in alternating runs, on a solid that may be coarser than the model itself.
rule time_methods:
    input:
        model=model_files,
        forests=FORESTS,
    output:
        f"{RESULTS}/models/{{model}}/methods.json",
    log:
        f"{LOGS}/models/{{model}}/methods.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/methods.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("time_methods", ranks=RANKS),
    params:
        source=source("studies.benchmark.command"),
        model=lambda wildcards: model_arguments(
            wildcards, timing.resolution(config, wildcards.model)
        ),
        how=lambda wildcards: timing.methods(config, wildcards.model),
        forest=forest_argument,
    shell:
        study_command("benchmark {params.model:q} {params.how:q} {params.forest:q}")
