# Errors and costs of the run's forests on single blocks (Fig. 9), in the report.


# Takes all cores although it uses one: its costs per block are timed.
rule rate_forests:
    input:
        FORESTS,
    output:
        f"{RESULTS}/forests/table.json",
    log:
        f"{LOGS}/forests/rate.log",
    benchmark:
        f"{BENCHMARKS}/forests/rate.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("rate_forests"),
    params:
        source=source("studies.blocks.command"),
        blocks=block_arguments(OWN.forests),
    shell:
        "python -m carillon study table --model {input:q} {params.blocks:q}"
        " --out {output:q} > {log:q} 2>&1"
