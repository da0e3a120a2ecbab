# What the default forests are worth, block by block: `snakemake forests_study`.
from studies.forests import study as forests_study

FORESTS_STUDY = place(forests_study.FORESTS)
STUDIED_FORESTS = (
    settings.forest_files(config["forests_study"]["model"]) or f"{DEFAULT_FOLDER}/forests.h5"
)
STUDY_TRAINING = forests_study.trainings(config)
STUDIED_SHARDS = expand(
    f"{DEFAULT_FOLDER}/dataset/{{name}}.h5",
    name=DEFAULT.first_shards(config["forests_study"]["shards"]),
)


use rule describe_forests as describe_studied_forests with:
    input:
        STUDIED_FORESTS,
    output:
        f"{FORESTS_STUDY}/model.json",
    log:
        f"{LOGS}/forests_study/describe.log",


# The rules below take all cores, although some use one, since they time what they do.
use rule rate_forests as compare_on_blocks with:
    input:
        STUDIED_FORESTS,
    output:
        f"{FORESTS_STUDY}/blocks.json",
    log:
        f"{LOGS}/forests_study/blocks.log",
    benchmark:
        f"{BENCHMARKS}/forests_study/blocks.tsv"
    params:
        source=source("studies.blocks.command"),
        blocks=block_arguments(config["forests_study"]),


rule benchmark_forests:
    input:
        STUDIED_FORESTS,
    output:
        f"{FORESTS_STUDY}/benchmark.json",
    log:
        f"{LOGS}/forests_study/benchmark.log",
    threads: SOLVER_CORES
    resources:
        **limits("benchmark_forests"),
    params:
        source=source("studies.forests.benchmark_command"),
        blocks=config["forests_study"]["timed_blocks"],
        largest=config["forests_study"]["largest"],
    shell:
        "python -m carillon study benchmark-forests --forest {input:q} --blocks {params.blocks:q}"
        " --largest {params.largest:q} --out {output:q} > {log:q} 2>&1"


rule compare_trainings:
    input:
        shards=STUDIED_SHARDS,
        checked=checked(STUDIED_SHARDS),
    output:
        f"{FORESTS_STUDY}/variants.json",
    log:
        f"{LOGS}/forests_study/variants.log",
    benchmark:
        f"{BENCHMARKS}/forests_study/variants.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("compare_trainings"),
    params:
        source=source("studies.forests.variants_command"),
        training=STUDY_TRAINING.train_arguments,
        leaves=config["forests_study"]["variant_leaves"],
        variants=[
            word
            for name in config["forests_study"]["variants"] or []
            for word in options({"only": name})
        ],
    shell:
        "python -m carillon study variants {input.shards:q} --checked {params.training:q}"
        " --max-leaves {params.leaves:q} {params.variants:q} --workers {threads} --out {output:q} > {log:q} 2>&1"


rule follow_learning:
    input:
        shards=DEFAULT_SHARDS,
        checked=checked(DEFAULT_SHARDS),
    output:
        f"{FORESTS_STUDY}/curve.json",
    log:
        f"{LOGS}/forests_study/curve.log",
    benchmark:
        f"{BENCHMARKS}/forests_study/curve.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("follow_learning"),
    params:
        source=source("studies.forests.curve_command"),
        data=STUDY_TRAINING.data_arguments,
        training=STUDY_TRAINING.train_arguments,
        rows=",".join(map(str, config["forests_study"]["curve_rows"])),
    shell:
        "python -m carillon study curve {input.shards:q} {params.data:q} {params.training:q}"
        " --rows {params.rows:q} --workers {threads} --out {output:q} > {log:q} 2>&1"
