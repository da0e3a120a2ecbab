# Blocks with random moduli and the coarse moduli fitted to them, one shard a job. A job that was
# killed leaves a journal beside its shard, from which the next try goes on.
WORKERS = config["dataset"]["workers"]
RANGE = "".join(
    f" --{end} {config['dataset'][end]}"
    for end in ("low", "high")
    if config["dataset"][end] is not None
)


rule generate_shard:
    output:
        f"{RESULTS}/dataset/shard-{{shard}}.h5",
    log:
        f"{LOGS}/dataset/shard-{{shard}}.log",
    benchmark:
        f"{BENCHMARKS}/dataset/shard-{{shard}}.tsv"
    retries: 2
    threads: WORKERS
    resources:
        mem_mb=500 + 500 * WORKERS,
        runtime="2h",
    params:
        samples=config["dataset"]["samples"],
        shards=config["dataset"]["shards"],
        seed=config["dataset"]["seed"],
        objective=config["dataset"]["objective"],
        poisson=config["poisson"],
        moduli=f"{config['dataset']['distribution']}{RANGE}",
    shell:
        "python -m dataset_gen generate --samples {params.samples} --seed {params.seed}"
        " --shard {wildcards.shard} --shards {params.shards} --objective {params.objective}"
        " --poisson {params.poisson} --distribution {params.moduli} --workers {threads}"
        " --out {output} > {log} 2>&1"


rule describe_shard:
    input:
        f"{RESULTS}/dataset/shard-{{shard}}.h5",
    output:
        f"{RESULTS}/dataset/shard-{{shard}}.json",
    log:
        f"{LOGS}/dataset/describe-{{shard}}.log",
    resources:
        mem_mb=1000,
        runtime="10m",
    shell:
        "python -m dataset_gen inspect {input} --json > {output}.partial 2> {log}"
        " && mv {output}.partial {output}"
