# All results as tables: CSV for programs, Markdown for people, JSON for the report.
from workflow.report import marks

TABLES = [
    "summary",
    "frequencies",
    "errors",
    "coarsening",
    "times",
    "methods",
    "spreads",
    "ratios",
    "convergence",
    "scaling",
    "phases",
    "training",
    "blocks",
    "evidence",
    "provenance",
]


rule save_config:
    output:
        f"{RESULTS}/config.yaml",
    log:
        f"{LOGS}/config.log",
    localrule: True
    resources:
        mem_mb=200,
        runtime="5m",
    params:
        source=source("workflow.scripts.save_config"),
        config=settings.resolved(config),
    script:
        "../scripts/save_config.py"


rule tabulate_results:
    input:
        config=f"{RESULTS}/config.yaml",
        shards=expand(f"{RESULTS}/dataset/{{name}}.json", name=settings.own_shards(config)),
        forests=f"{RESULTS}/forests/forests.json",
        blocks=f"{RESULTS}/forests/table.json",
        modes=expand(
            f"{RESULTS}/models/{{model}}/{{variant}}.h5",
            model=MODELS,
            variant=list(variants.VARIANTS),
        ),
        comparisons=expand(
            f"{RESULTS}/models/{{model}}/{{variant}}.comparison.json",
            model=MODELS,
            variant=variants.CANDIDATES,
        ),
        convergence=expand(
            f"{RESULTS}/models/{{model}}/convergence.json",
            model=config["convergence"]["models"],
        ),
        methods=expand(f"{RESULTS}/models/{{model}}/methods.json", model=config["times"]["models"]),
        scaling=expand(
            f"{RESULTS}/models/{{model}}/scaling.json", model=config["scaling"]["models"]
        ),
    output:
        marks.tables(f"{RESULTS}/tables", TABLES, "all"),
    log:
        f"{LOGS}/tables.log",
    localrule: True
    resources:
        mem_mb=2000,
        runtime="10m",
    params:
        source=source("workflow.scripts.tabulate_results"),
        tables=TABLES,
    script:
        "../scripts/tabulate_results.py"
