# How fast the error correction converges on the models of a run.


def convergence_arguments(wildcards, input):
    """How the convergence of a model is followed; of no more modes than it has."""
    part = config["convergence"]
    modes = min(part["modes"], model_modes(wildcards))
    return options({"modes": modes, "steps": part["steps"], "truth": input.truth})


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
        how=convergence_arguments,
    shell:
        "python -m solver convergence {params.model:q} {params.how:q}"
        " --out {output:q} > {log:q} 2>&1"
