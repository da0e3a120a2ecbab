# The two regression forests, and how well they do on blocks they have not seen. Splits are chosen from a
# subset of the data, each tree in a job of its own; leaves are fitted to all of it in one more.
OWN_FORESTS = f"{RESULTS}/forests/forests.h5"
FORESTS = settings.forests_file(config) or OWN_FORESTS
OWN_SHARDS = expand(f"{RESULTS}/dataset/{{name}}.h5", name=OWN.shards)


wildcard_constraints:
    tree=r"\d+",


rule grow_tree:
    input:
        shards=OWN_SHARDS,
        checked=checked(OWN_SHARDS),
    output:
        f"{RESULTS}/forests/trees/{{tree}}.h5",
    log:
        f"{LOGS}/forests/trees/{{tree}}.log",
    benchmark:
        f"{BENCHMARKS}/forests/trees/{{tree}}.tsv"
    threads: OWN.cores(1)
    resources:
        **tree_limits("grow_tree", OWN),
    params:
        source=source("forests.commands.grow"),
        data=OWN.data_arguments,
        training=OWN.train_arguments,
    shell:
        trees_command(
            OWN,
            "grow",
            "{input.shards:q} {params.data:q} {params.training:q} --tree {wildcards.tree:q}",
        )


rule train_forests:
    input:
        shards=OWN_SHARDS,
        checked=checked(OWN_SHARDS),
        trees=expand(f"{RESULTS}/forests/trees/{{tree}}.h5", tree=OWN.trees),
    output:
        OWN_FORESTS,
    log:
        f"{LOGS}/forests/train.log",
    benchmark:
        f"{BENCHMARKS}/forests/train.tsv"
    threads: OWN.cores(SOLVER_CORES)
    resources:
        **leaves_limits("train_forests", OWN),
    params:
        source=source("forests.commands.train"),
        data=OWN.data_arguments,
        training=OWN.train_arguments,
    shell:
        trees_command(
            OWN,
            "train",
            "{input.shards:q} {params.data:q} {params.training:q} --structure {input.trees:q}",
        )


rule describe_forests:
    input:
        FORESTS,
    output:
        f"{RESULTS}/forests/forests.json",
    log:
        f"{LOGS}/forests/describe.log",
    localrule: True
    params:
        source=source("forests.commands.inspect"),
    shell:
        "python -m forests inspect {input:q} --json > {output:q}.partial 2> {log:q}"
        " && mv {output:q}.partial {output:q}"
