# Discretisations against frequencies that no mesh made: `snakemake accuracy`, no part of the
# default run.
from studies.accuracy import study as accuracy_study
from importlib.util import find_spec


rule accuracy:
    input:
        f"{place(accuracy_study.ACCURACY)}/report.html",


# It takes all cores, although it uses one, since it times what it does.
rule measure_accuracy:
    output:
        f"{place(accuracy_study.ACCURACY)}/accuracy.json",
    log:
        f"{LOGS}/accuracy/accuracy.log",
    benchmark:
        f"{BENCHMARKS}/accuracy/accuracy.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("measure_accuracy"),
    params:
        source=source("studies.accuracy.command"),
        how=accuracy_study.arguments(config),
        others=[name for name in ("gmsh", "skfem") if find_spec(name)],
    shell:
        "python -m solver accuracy {params.how:q} --out {output:q} > {log:q} 2>&1"
