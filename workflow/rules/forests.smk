# The two regression forests, and how well they do on blocks they have not seen.
OWN_FORESTS = f"{RESULTS}/forests/forests.h5"
FORESTS = settings.forests_file(config) or OWN_FORESTS


rule train_forests:
    input:
        expand(f"{RESULTS}/dataset/{{name}}.h5", name=OWN.shards),
    output:
        OWN_FORESTS,
    log:
        f"{LOGS}/forests/train.log",
    benchmark:
        f"{BENCHMARKS}/forests/train.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("train_forests", training_memory(OWN), OWN.forests["ranks"]),
    params:
        source=source("forests.commands.train"),
        training=OWN.train_arguments,
    shell:
        train_command(OWN, "{input:q} {params.training:q}")


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
