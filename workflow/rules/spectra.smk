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
    threads: SOLVER_CORES
    resources:
        mpi=launcher(RANKS),
        tasks=RANKS,
        cpus_per_task=cores_of(RANKS),
        mem_mb=growing(8000),
        runtime=growing(120),
    params:
        source=source("solver.problem", "solver.modes_file", "solver.__main__"),
        ranks=RANKS,
        on_ranks=on_ranks(RANKS),
        model=model_arguments,
        variant=variant_arguments,
        modes=model_modes,
    shell:
        "OMP_NUM_THREADS=$(( {threads} > {params.ranks} ? {threads} / {params.ranks} : 1 ))"
        " {resources.mpi} {params.on_ranks} -m solver modes"
        " {params.model} {params.variant}"
        " --modes {params.modes} --out {output} > {log} 2>&1"


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
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(8000),
        runtime=growing(120),
    params:
        source=source("solver.convergence", "solver.__main__"),
        model=model_arguments,
        modes=lambda wildcards: min(config["convergence"]["modes"], model_modes(wildcards)),
        steps=config["convergence"]["steps"],
    shell:
        "OMP_NUM_THREADS={threads} python -m solver convergence {params.model}"
        " --modes {params.modes} --steps {params.steps} --truth {input.truth} --out {output}"
        " > {log} 2>&1"


rule compare_with_truth:
    input:
        candidate=f"{RESULTS}/models/{{model}}/{{variant}}.h5",
        truth=f"{RESULTS}/models/{{model}}/{variants.TRUTH}.h5",
    output:
        f"{RESULTS}/models/{{model}}/{{variant}}.comparison.json",
    log:
        f"{LOGS}/models/{{model}}/{{variant}}.comparison.log",
    threads: 1
    resources:
        mem_mb=growing(4000),
        runtime=growing(30),
    params:
        source=source("solver.comparison"),
    shell:
        "OMP_NUM_THREADS={threads} python -m solver compare {input.candidate} {input.truth} --json"
        " > {output}.partial 2> {log} && mv {output}.partial {output}"


# All methods in alternating runs, on a solid that may be coarser than the model itself.
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
        mpi=launcher(RANKS),
        tasks=RANKS,
        cpus_per_task=cores_of(RANKS),
        mem_mb=growing(8000),
        runtime=growing(240),
    params:
        source=source("solver.benchmark", "solver.__main__"),
        ranks=RANKS,
        on_ranks=on_ranks(RANKS),
        model=timed_arguments,
        how=times_arguments(config["times"]),
        forest=forest_argument,
    shell:
        "OMP_NUM_THREADS=$(( {threads} > {params.ranks} ? {threads} / {params.ranks} : 1 ))"
        " {resources.mpi} {params.on_ranks} -m solver benchmark"
        " {params.model} {params.how} {params.forest} --out {output} > {log} 2>&1"
