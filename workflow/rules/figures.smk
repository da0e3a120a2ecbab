# The paper's Fig. 10 and 11 and the scaling over ranks, in full: `snakemake figures`, no part of the
# default run.


rule figures:
    input:
        f"{place(catalogue.FIGURES)}/report.html",


# Rules that time what they do take all cores, although some use one. The forests are those of the
# package.
use rule time_methods as time_methods_in_full with:
    input:
        model=shape_mesh,
        forests=settings.forest_files(),
    output:
        f"{place(catalogue.FIGURES)}/models/{{shape}}/methods.json",
    log:
        f"{LOGS}/{catalogue.FIGURES.folder}/{{shape}}/methods.log",
    benchmark:
        f"{BENCHMARKS}/{catalogue.FIGURES.folder}/{{shape}}/methods.tsv"
    params:
        source=source("solver.commands.benchmark"),
        model=shape_arguments,
        how=times_arguments(config["figures"]),
        forest=forest_argument,


use rule follow_convergence as follow_convergence_in_full with:
    input:
        shape_mesh,
    output:
        f"{place(catalogue.FIGURES)}/models/{{shape}}/convergence.json",
    log:
        f"{LOGS}/{catalogue.FIGURES.folder}/{{shape}}/convergence.log",
    benchmark:
        f"{BENCHMARKS}/{catalogue.FIGURES.folder}/{{shape}}/convergence.tsv"
    resources:
        **limits("follow_convergence_in_full"),
    params:
        source=source("solver.commands.convergence"),
        model=shape_arguments,
        how=options({key: config["figures"][key] for key in ("modes", "steps")}),


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
        model=shape_arguments,
        how=scaling_arguments(config["figures"]),
    shell:
        "python -m solver scaling {params.model:q} {params.how:q} --out {output:q} > {log:q} 2>&1"
