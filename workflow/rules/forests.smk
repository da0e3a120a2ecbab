# The two regression forests, and how well they do on blocks they have not seen.


rule train_forests:
    input:
        expand(f"{RESULTS}/dataset/{{name}}.h5", name=OWN.shards),
    output:
        f"{RESULTS}/forests/forests.h5",
    log:
        f"{LOGS}/forests/train.log",
    benchmark:
        f"{BENCHMARKS}/forests/train.tsv"
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(4000),
        runtime=growing(240),
    params:
        source=source("forests.training.command"),
        training=OWN.train_arguments,
    shell:
        "python -m forests train {input} {params.training} --workers {threads} --out {output}"
        " > {log} 2>&1"


rule describe_forests:
    input:
        f"{RESULTS}/forests/forests.h5",
    output:
        f"{RESULTS}/forests/forests.json",
    log:
        f"{LOGS}/forests/describe.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("forests.summary"),
    shell:
        "python -m forests inspect {input} --json > {output}.partial 2> {log}"
        " && mv {output}.partial {output}"


# Takes all cores although it uses one: its costs per block are timed.
rule rate_forests:
    input:
        f"{RESULTS}/forests/forests.h5",
    output:
        f"{RESULTS}/forests/table.json",
    log:
        f"{LOGS}/forests/rate.log",
    benchmark:
        f"{BENCHMARKS}/forests/rate.tsv"
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(2000),
        runtime=growing(30),
    params:
        source=source("forests.comparison.table"),
        blocks=OWN.forests["blocks"],
        materials=OWN.forests["materials"],
    shell:
        "python -m forests table --model {input} --blocks {params.blocks}"
        " --materials {params.materials} --out {output} > {log} 2>&1"
