# The forests that come with the package: `snakemake default_forest`, no part of the default run.
# Its result is put into the package by hand: cp results/default_forest/forests.h5 forests/default.h5
DEFAULT = training.default(config)
DEFAULT_FOLDER = f"{RESULTS}/default_forest"
DEFAULT_SHARDS = expand(f"{DEFAULT_FOLDER}/dataset/{{name}}.h5", name=DEFAULT.shards)


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


use rule describe_shard as describe_default_shard with:
    input:
        f"{DEFAULT_FOLDER}/dataset/{{distribution}}-{{shard}}.h5",
    output:
        f"{DEFAULT_FOLDER}/dataset/{{distribution}}-{{shard}}.json",
    log:
        f"{LOGS}/default_forest/dataset/describe-{{distribution}}-{{shard}}.log",
    benchmark:
        f"{BENCHMARKS}/default_forest/dataset/describe-{{distribution}}-{{shard}}.tsv"


use rule grow_tree as grow_default_tree with:
    input:
        shards=DEFAULT_SHARDS,
        checked=checked(DEFAULT_SHARDS),
    output:
        f"{DEFAULT_FOLDER}/trees/{{tree}}.h5",
    log:
        f"{LOGS}/default_forest/trees/{{tree}}.log",
    benchmark:
        f"{BENCHMARKS}/default_forest/trees/{{tree}}.tsv"
    threads: DEFAULT.cores(1)
    resources:
        **tree_limits("grow_default_tree", DEFAULT),
    params:
        source=source("forests.commands.grow"),
        data=DEFAULT.data_arguments,
        training=DEFAULT.train_arguments,


use rule train_forests as train_default_forest with:
    input:
        shards=DEFAULT_SHARDS,
        checked=checked(DEFAULT_SHARDS),
        trees=expand(f"{DEFAULT_FOLDER}/trees/{{tree}}.h5", tree=DEFAULT.trees),
    output:
        f"{DEFAULT_FOLDER}/forests.h5",
    log:
        f"{LOGS}/default_forest/train.log",
    benchmark:
        f"{BENCHMARKS}/default_forest/train.tsv"
    threads: DEFAULT.cores(SOLVER_CORES)
    resources:
        **leaves_limits("train_default_forest", DEFAULT),
    params:
        source=source("forests.commands.train"),
        data=DEFAULT.data_arguments,
        training=DEFAULT.train_arguments,


use rule describe_forests as describe_default_forest with:
    input:
        f"{DEFAULT_FOLDER}/forests.h5",
    output:
        f"{DEFAULT_FOLDER}/forests.json",
    log:
        f"{LOGS}/default_forest/describe.log",
