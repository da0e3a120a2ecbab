# The two regression forests, and how well they do on blocks they have not seen.


rule train_forests:
    input:
        expand(
            f"{RESULTS}/dataset/shard-{{shard}}.h5",
            shard=range(config["dataset"]["shards"]),
        ),
    output:
        f"{RESULTS}/forests/forests.h5",
    log:
        f"{LOGS}/forests/train.log",
    benchmark:
        f"{BENCHMARKS}/forests/train.tsv"
    threads: SOLVER_CORES
    resources:
        mem_mb=4000,
        runtime="4h",
    params:
        trees=config["forests"]["trees"],
        depth=config["forests"]["depth"],
        seed=config["forests"]["seed"],
    shell:
        "python -m forests train {input} --trees {params.trees} --depth {params.depth}"
        " --seed {params.seed} --workers {threads} --out {output} > {log} 2>&1"


rule describe_forests:
    input:
        f"{RESULTS}/forests/forests.h5",
    output:
        f"{RESULTS}/forests/forests.json",
    log:
        f"{LOGS}/forests/describe.log",
    resources:
        mem_mb=1000,
        runtime="10m",
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
        mem_mb=2000,
        runtime="30m",
    shell:
        "python -m forests table --model {input} --json > {output}.partial 2> {log}"
        " && mv {output}.partial {output}"
