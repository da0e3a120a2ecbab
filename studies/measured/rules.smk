# Solids whose frequencies were measured or published: `snakemake measured`.
from studies.measured import data_files as measured_files
from studies.measured import study as measured_study


rule measure_measured_solids:
    input:
        sorted(str(path) for path in measured_files.FOLDER.glob("*.yaml")),
    output:
        f"{place(measured_study.MEASURED)}/measured.json",
    log:
        f"{LOGS}/measured/measured.log",
    benchmark:
        f"{BENCHMARKS}/measured/measured.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("measure_measured_solids"),
    params:
        source=source("studies.measured.command"),
        how=measured_study.arguments(config),
    shell:
        "python -m carillon study measured {params.how:q} --out {output:q} > {log:q} 2>&1"
