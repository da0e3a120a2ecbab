# Discretisations against frequencies that no mesh made: `snakemake accuracy`, no part of the
# default run.
from importlib.util import find_spec


rule accuracy:
    input:
        f"{place(catalogue.ACCURACY)}/report.html",


# It takes all cores, although it uses one, since it times what it does.
rule measure_accuracy:
    output:
        f"{place(catalogue.ACCURACY)}/accuracy.json",
    log:
        f"{LOGS}/accuracy/accuracy.log",
    benchmark:
        f"{BENCHMARKS}/accuracy/accuracy.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("measure_accuracy"),
    params:
        source=source("solver.commands.accuracy"),
        how=accuracy_arguments(),
        others=[name for name in ("gmsh", "skfem") if find_spec(name)],
    shell:
        "python -m solver accuracy {params.how:q} --out {output:q} > {log:q} 2>&1"
