# The paper's Fig. 10 and 11 and the scaling over ranks, in full: `snakemake figures`.
from studies.figures import study as figures_study


wildcard_constraints:
    shape="|".join(config["figures"]["models"]),


# Rules that time what they do take all cores, although some use one. The forests are those of the
# package.
use rule time_methods as time_methods_in_full with:
    input:
        model=lambda wildcards: solids.mesh_files(config, "figures", wildcards.shape),
        forests=settings.forest_files(),
    output:
        f"{place(figures_study.FIGURES)}/models/{{shape}}/methods.json",
    log:
        f"{LOGS}/{figures_study.FIGURES.folder}/{{shape}}/methods.log",
    benchmark:
        f"{BENCHMARKS}/{figures_study.FIGURES.folder}/{{shape}}/methods.tsv"
    params:
        source=source("studies.benchmark.command"),
        model=lambda wildcards: figures_study.arguments(config, wildcards.shape),
        how=timing.arguments(config["figures"]),
        forest=forest_argument,


use rule follow_convergence as follow_convergence_in_full with:
    input:
        lambda wildcards: solids.mesh_files(config, "figures", wildcards.shape),
    output:
        f"{place(figures_study.FIGURES)}/models/{{shape}}/convergence.json",
    log:
        f"{LOGS}/{figures_study.FIGURES.folder}/{{shape}}/convergence.log",
    benchmark:
        f"{BENCHMARKS}/{figures_study.FIGURES.folder}/{{shape}}/convergence.tsv"
    resources:
        **limits("follow_convergence_in_full"),
    params:
        source=source("studies.convergence.command"),
        model=lambda wildcards: figures_study.arguments(config, wildcards.shape),
        how=options({key: config["figures"][key] for key in ("modes", "steps")}),


use rule measure_scaling_of_run as measure_scaling with:
    input:
        lambda wildcards: solids.mesh_files(config, "figures", wildcards.shape),
    output:
        f"{place(figures_study.FIGURES)}/models/{{shape}}/scaling.json",
    log:
        f"{LOGS}/{figures_study.FIGURES.folder}/{{shape}}/scaling.log",
    benchmark:
        f"{BENCHMARKS}/{figures_study.FIGURES.folder}/{{shape}}/scaling.tsv"
    params:
        source=source("studies.scaling.command"),
        model=lambda wildcards: figures_study.arguments(config, wildcards.shape),
        how=scaling.arguments(config["figures"]),
