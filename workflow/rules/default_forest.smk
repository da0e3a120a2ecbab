# The forests that come with the package: `snakemake default_forest`, no part of the default run.
# Its result is put into the package by hand: cp results/default_forest/forests.h5 forests/default.h5
DEFAULT = training.default(config)
DEFAULT_FOLDER = f"{RESULTS}/default_forest"
DEFAULT_SHARDS = expand(f"{DEFAULT_FOLDER}/dataset/{{name}}.h5", name=DEFAULT.shards)


wildcard_constraints:
    tree=r"\d+",


rule default_forest:
    input:
        f"{DEFAULT_FOLDER}/forests.h5",
        f"{DEFAULT_FOLDER}/forests.json",


use rule generate_shard as generate_default_shard with:
    output:
        f"{DEFAULT_FOLDER}/dataset/{{distribution}}-{{shard}}.h5",
    log:
        f"{LOGS}/default_forest/dataset/{{distribution}}-{{shard}}.log",
    benchmark:
        f"{BENCHMARKS}/default_forest/dataset/{{distribution}}-{{shard}}.tsv"
    threads: DEFAULT.dataset["workers"]
    resources:
        **limits("generate_default_shard", shard_memory(DEFAULT)),
    params:
        source=source("dataset_gen.commands.generate"),
        samples=lambda wildcards: DEFAULT.generate_arguments(
            wildcards.distribution, wildcards.shard
        ),


# Splits are chosen from a subset, tree by tree; leaves are fitted to all rows in one job.
rule grow_tree:
    input:
        DEFAULT_SHARDS,
    output:
        f"{DEFAULT_FOLDER}/trees/{{tree}}.h5",
    log:
        f"{LOGS}/default_forest/trees/{{tree}}.log",
    benchmark:
        f"{BENCHMARKS}/default_forest/trees/{{tree}}.tsv"
    resources:
        **limits("grow_tree", tree_memory(DEFAULT)),
    params:
        source=source("forests.commands.grow"),
        training=DEFAULT.train_arguments,
    shell:
        "python -m forests grow {input:q} {params.training:q} --tree {wildcards.tree:q}"
        " --out {output:q} > {log:q} 2>&1"


rule train_default_forest:
    input:
        shards=DEFAULT_SHARDS,
        trees=expand(f"{DEFAULT_FOLDER}/trees/{{tree}}.h5", tree=DEFAULT.trees),
    output:
        f"{DEFAULT_FOLDER}/forests.h5",
    log:
        f"{LOGS}/default_forest/train.log",
    benchmark:
        f"{BENCHMARKS}/default_forest/train.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("train_default_forest", training_memory(DEFAULT), DEFAULT.forests["ranks"]),
    params:
        source=source("forests.commands.train"),
        training=DEFAULT.train_arguments,
    shell:
        train_command(DEFAULT, "{input.shards:q} {params.training:q} --structure {input.trees:q}")


use rule describe_forests as describe_default_forest with:
    input:
        f"{DEFAULT_FOLDER}/forests.h5",
    output:
        f"{DEFAULT_FOLDER}/forests.json",
    log:
        f"{LOGS}/default_forest/describe.log",
