# Modes of every model by every variant, how they converge, and how far they are from the truth.


rule find_modes:
    input:
        model=model_files,
        forests=variant_files,
    output:
        f"{RESULTS}/models/{{model}}/{{variant}}.h5",
    log:
        f"{LOGS}/models/{{model}}/{{variant}}.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/{{variant}}.tsv"
    threads: RUN_CORES
    resources:
        **limits("find_modes", ranks=RANKS, cores=RUN_CORES),
    params:
        source=source("solver.commands.modes"),
        model=model_arguments,
        variant=variant_arguments,
        modes=model_modes,
    shell:
        solver_command("modes {params.model:q} {params.variant:q} --modes {params.modes:q}")


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
        source=source("solver.commands.convergence"),
        model=model_arguments,
        how=convergence_arguments,
    shell:
        "python -m solver convergence {params.model:q} {params.how:q}"
        " --out {output:q} > {log:q} 2>&1"


# What a validation looks at, and `further_` what the report needs besides.
rule compare_with_truth:
    input:
        candidates=compared_files,
        truth=f"{RESULTS}/models/{{model}}/{variants.TRUTH}.h5",
    output:
        f"{RESULTS}/models/{{model}}/{{further}}comparisons.json",
    log:
        f"{LOGS}/models/{{model}}/{{further}}comparisons.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/{{further}}comparisons.tsv"
    wildcard_constraints:
        further="(further_)?",
    resources:
        **limits("compare_with_truth"),
    params:
        source=source("solver.commands.compare"),
    shell:
        "python -m solver compare {input.candidates:q} {input.truth:q}"
        " --out {output:q} > {log:q} 2>&1"


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
        source=source("solver.commands.benchmark"),
        model=lambda wildcards: model_arguments(wildcards, timed_resolution(wildcards)),
        how=timed_methods,
        forest=forest_argument,
    shell:
        solver_command("benchmark {params.model:q} {params.how:q} {params.forest:q}")
