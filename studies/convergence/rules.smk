# How fast the error correction converges on the models of a run.
from studies.convergence import config as convergence


rule follow_convergence:
    input:
        model=model_files,
        truth=f"{RESULTS}/models/{{model}}/{variants.TRUTH}.h5",
    output:
        f"{RESULTS}/models/{{model}}/convergence.json",
    log:
        f"{LOGS}/models/{{model}}/convergence.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/convergence.tsv"
    threads: RUN_CORES
    resources:
        **limits("follow_convergence"),
    params:
        source=source("studies.convergence.command"),
        model=model_arguments,
        how=lambda wildcards, input: convergence.arguments(
            config["convergence"], model_modes(wildcards), input.truth
        ),
    shell:
        "python -m carillon study convergence {params.model:q} {params.how:q}"
        " --out {output:q} > {log:q} 2>&1"
