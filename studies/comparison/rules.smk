# A run beside another one: `snakemake compare --config baseline=FOLDER`, and the small tables that
# are kept for others to compare theirs with: `snakemake reference`.
from workflow.report import study as report_study
from carillon.records.provenance import compiled_for
from studies.comparison.folders import require_tables

if config["baseline"]:
    try:
        require_tables(config["baseline"])
    except UserError as error:
        raise WorkflowError(f"baseline: {error}") from None


include: "functions.smk"


rule compare:
    input:
        require_baseline,
        config=f"{RESULTS}/config.yaml",
        tables=tables_in(report_study.REPORT),
    log:
        f"{LOGS}/compare.log",
    localrule: True
    params:
        source=source("studies.comparison.command"),
        baseline=config["baseline"],
        results=lambda wildcards, input: str(Path(input.config).parent),
    shell:
        "python -m carillon study compare-runs {params.baseline:q} {params.results:q}"
        " --out {params.results:q}/comparison 2>&1 | tee {log:q}"


rule reference:
    input:
        config=f"{RESULTS}/config.yaml",
        report=f"{RESULTS}/report.html",
        tables=tables_in(report_study.REPORT),
    output:
        f"{RESULTS}/reference/{compiled_for()}/README.md",
    log:
        f"{LOGS}/reference.log",
    localrule: True
    params:
        source=source("studies.comparison.scripts.write_reference"),
        processor=compiled_for(),
    script:
        "scripts/write_reference.py"
