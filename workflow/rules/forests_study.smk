# What the default forests are worth, block by block: `snakemake forests_study`, no part of the
# default run.
from workflow.forests_study import plots as study_plots
from workflow.forests_study import tables as study_tables

FORESTS_STUDY = f"{RESULTS}/forests_study"
STUDIED_FORESTS = settings.studied_model(config) or f"{DEFAULT_FOLDER}/forests.h5"
STUDY_TRAINING = training.study(config)


rule forests_study:
    input:
        f"{FORESTS_STUDY}/report.html",


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
        source=source("forests.commands.table"),
        blocks=config["forests_study"]["blocks"],
        materials=config["forests_study"]["materials"],


rule benchmark_forests:
    input:
        STUDIED_FORESTS,
    output:
        f"{FORESTS_STUDY}/benchmark.json",
    log:
        f"{LOGS}/forests_study/benchmark.log",
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(2000),
        runtime=growing(30),
    params:
        source=source("forests.commands.benchmark"),
        blocks=config["forests_study"]["timed_blocks"],
        largest=config["forests_study"]["largest"],
    shell:
        "python -m forests benchmark --forest {input:q} --blocks {params.blocks:q}"
        " --largest {params.largest:q} --out {output:q} > {log:q} 2>&1"


rule compare_trainings:
    input:
        expand(
            f"{DEFAULT_FOLDER}/dataset/{{name}}.h5",
            name=DEFAULT.first_shards(config["forests_study"]["shards"]),
        ),
    output:
        f"{FORESTS_STUDY}/variants.json",
    log:
        f"{LOGS}/forests_study/variants.log",
    benchmark:
        f"{BENCHMARKS}/forests_study/variants.tsv"
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(8000),
        runtime=growing(240),
    params:
        source=source("forests.commands.variants"),
        training=STUDY_TRAINING.train_arguments,
        leaves=config["forests_study"]["variant_leaves"],
        variants=[
            word
            for name in config["forests_study"]["variants"] or []
            for word in options({"only": name})
        ],
    shell:
        "python -m forests variants {input:q} {params.training:q} --max-leaves {params.leaves:q}"
        " {params.variants:q} --workers {threads} --out {output:q} > {log:q} 2>&1"


rule follow_learning:
    input:
        DEFAULT_SHARDS,
    output:
        f"{FORESTS_STUDY}/curve.json",
    log:
        f"{LOGS}/forests_study/curve.log",
    benchmark:
        f"{BENCHMARKS}/forests_study/curve.tsv"
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(8000),
        runtime=growing(240),
    params:
        source=source("forests.commands.curve"),
        training=STUDY_TRAINING.train_arguments,
        rows=",".join(map(str, config["forests_study"]["curve_rows"])),
    shell:
        "python -m forests curve {input:q} {params.training:q} --rows {params.rows:q}"
        " --workers {threads} --out {output:q} > {log:q} 2>&1"


rule tabulate_forests_study:
    input:
        config=f"{RESULTS}/config.yaml",
        found=expand(
            f"{FORESTS_STUDY}/{{part}}.json",
            part=["model", "blocks", "benchmark", "variants", "curve"],
        ),
    output:
        marks.tables(f"{FORESTS_STUDY}/tables", study_tables.BUILDERS, "forests_study"),
    log:
        f"{LOGS}/forests_study/tables.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.tabulate_forests_study"),
    script:
        "../scripts/tabulate_forests_study.py"


rule plot_forests_study:
    input:
        config=f"{RESULTS}/config.yaml",
        found=expand(
            f"{FORESTS_STUDY}/{{part}}.json", part=["blocks", "benchmark", "variants", "curve"]
        ),
    output:
        svg=report(
            f"{FORESTS_STUDY}/figures/{{figure}}.svg",
            caption="../report/captions/forest_scores.rst",
            category="Figures",
            subcategory="forests_study",
            labels=lambda wildcards: {"figure": marks.SHOWS[wildcards.figure]},
        ),
        png=f"{FORESTS_STUDY}/figures/{{figure}}.png",
    log:
        f"{LOGS}/forests_study/{{figure}}.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.plot_forests_study"),
    script:
        "../scripts/plot_forests_study.py"


rule build_forests_report:
    input:
        config=f"{RESULTS}/config.yaml",
        tables=expand(f"{FORESTS_STUDY}/tables/{{table}}.json", table=list(study_tables.BUILDERS)),
        figures=expand(f"{FORESTS_STUDY}/figures/{{figure}}.svg", figure=list(study_plots.FIGURES)),
        templates=templates("forests_study"),
    output:
        report(
            f"{FORESTS_STUDY}/report.html",
            caption="../report/captions/forests.rst",
            category="Report",
            labels={"page": "The default forests"},
        ),
    log:
        f"{LOGS}/forests_study/report.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.build_forests_report"),
    script:
        "../scripts/build_forests_report.py"
