# Blocks with random moduli and the coarse moduli fitted to them, one shard a job. A job that was
# killed leaves a journal beside its shard, from which the next try goes on.
OWN = training.own(config)


rule generate_shard:
    output:
        f"{RESULTS}/dataset/{{distribution}}-{{shard}}.h5",
    log:
        f"{LOGS}/dataset/{{distribution}}-{{shard}}.log",
    benchmark:
        f"{BENCHMARKS}/dataset/{{distribution}}-{{shard}}.tsv"
    retries: 2
    threads: OWN.dataset["workers"]
    resources:
        **limits("generate_shard", shard_memory(OWN)),
    params:
        source=source("dataset_gen.commands.generate"),
        samples=lambda wildcards: OWN.generate_arguments(wildcards.distribution, wildcards.shard),
    shell:
        "python -m dataset_gen generate {params.samples:q} --workers {threads}"
        " --out {output:q} > {log:q} 2>&1"


# It reads all of a shard and compares every checksum, so that the jobs that train need not.
rule describe_shard:
    input:
        f"{RESULTS}/dataset/{{distribution}}-{{shard}}.h5",
    output:
        f"{RESULTS}/dataset/{{distribution}}-{{shard}}.json",
    log:
        f"{LOGS}/dataset/describe-{{distribution}}-{{shard}}.log",
    benchmark:
        f"{BENCHMARKS}/dataset/describe-{{distribution}}-{{shard}}.tsv"
    resources:
        **limits("describe_shard"),
    params:
        source=source("dataset_gen.commands.inspect"),
    shell:
        "python -m dataset_gen inspect {input:q} --json > {output:q}.partial 2> {log:q}"
        " && mv {output:q}.partial {output:q}"
