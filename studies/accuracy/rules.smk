# Discretisations against frequencies that no mesh made: `snakemake accuracy`.
from importlib.util import find_spec

from studies.accuracy import study as accuracy_study


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
        "python -m carillon study accuracy {params.how:q} --out {output:q} > {log:q} 2>&1"
