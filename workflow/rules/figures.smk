# The paper's Fig. 10 and 11 and the scaling over ranks, in full: `snakemake figures`, no part of the
# default run.


rule figures:
    input:
        f"{place(catalogue.FIGURES)}/report.html",


# The rules below take all cores, although some use one, since they time what they do. The forests
# are those of the package.
use rule time_methods as time_methods_in_full with:
    input:
        model=shape_mesh,
        forests=settings.default_forest_files(),
    output:
        f"{place(catalogue.FIGURES)}/models/{{shape}}/methods.json",
    log:
        f"{LOGS}/{catalogue.FIGURES.folder}/{{shape}}/methods.log",
    benchmark:
        f"{BENCHMARKS}/{catalogue.FIGURES.folder}/{{shape}}/methods.tsv"
    params:
        source=source("solver.commands.benchmark"),
        ranks=RANKS,
        on_ranks=on_ranks(RANKS),
        model=shape_arguments,
        how=times_arguments(config["figures"]),
        forest=forest_argument,


rule follow_convergence_in_full:
    input:
        shape_mesh,
    output:
        f"{place(catalogue.FIGURES)}/models/{{shape}}/convergence.json",
    log:
        f"{LOGS}/{catalogue.FIGURES.folder}/{{shape}}/convergence.log",
    benchmark:
        f"{BENCHMARKS}/{catalogue.FIGURES.folder}/{{shape}}/convergence.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("follow_convergence_in_full"),
    params:
        source=source("solver.commands.convergence"),
        shape=shape_arguments,
        modes=config["figures"]["modes"],
        steps=config["figures"]["steps"],
    shell:
        "OMP_NUM_THREADS={threads} python -m solver convergence {params.shape:q}"
        " --modes {params.modes:q} --steps {params.steps:q} --out {output:q} > {log:q} 2>&1"


# It starts the ranks itself, one thread each.
rule measure_scaling:
    input:
        shape_mesh,
    output:
        f"{place(catalogue.FIGURES)}/models/{{shape}}/scaling.json",
    log:
        f"{LOGS}/{catalogue.FIGURES.folder}/{{shape}}/scaling.log",
    benchmark:
        f"{BENCHMARKS}/{catalogue.FIGURES.folder}/{{shape}}/scaling.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("measure_scaling"),
    params:
        source=source("solver.commands.scaling"),
        shape=shape_arguments,
        modes=config["figures"]["modes"],
        ranks=",".join(map(str, config["figures"]["ranks"])),
        weak=options({"weak": config["figures"]["weak"]}),
    shell:
        "python -m solver scaling {params.shape:q} --modes {params.modes:q}"
        " --ranks {params.ranks:q} {params.weak:q} --out {output:q} > {log:q} 2>&1"
