# Modes of every model by every variant, and how far they are from the truth.


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
