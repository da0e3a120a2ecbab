# Validations of solids x materials x seeds x ranks: `snakemake campaign`.
from studies.campaign import study as campaign_study
from studies.campaign.cells import Cell, validation_arguments

CAMPAIGN = place(campaign_study.CAMPAIGN)


# Its files are there already when it fails, as it does if a cell has not passed.
rule campaign:
    input:
        f"{CAMPAIGN}/report.html",
        f"{CAMPAIGN}/junit.xml",
        verdict=f"{CAMPAIGN}/verdict.json",
    log:
        f"{LOGS}/campaign/campaign.log",
    localrule: True
    params:
        source=source("studies.campaign.verdict"),
    shell:
        "python -m studies.campaign.verdict {input.verdict:q} 2>&1 | tee {log:q}"


# Never fails: a cell whose run did is a result as well.
rule validate_cell:
    input:
        mesh=lambda wildcards: solids.mesh_files(config, "campaign", wildcards.solid),
        forest=settings.forest_files(config["campaign"]["forest"]),
    output:
        f"{CAMPAIGN}/cells/{{solid}}/{{material}}-{{seed}}-{{ranks}}.json",
    log:
        f"{LOGS}/campaign/{{solid}}/{{material}}-{{seed}}-{{ranks}}.log",
    benchmark:
        f"{BENCHMARKS}/campaign/{{solid}}/{{material}}-{{seed}}-{{ranks}}.tsv"
    wildcard_constraints:
        seed=r"\d+",
        ranks=r"\d+",
    threads: lambda wildcards: max(int(wildcards.ranks), RUN_CORES)
    resources:
        **limits("validate_cell"),
    params:
        source=source("studies.campaign.scripts.validate_cell", "workflow.commands.validate"),
        arguments=lambda wildcards: validation_arguments(
            config,
            Cell(
                wildcards.solid,
                wildcards.material,
                int(wildcards.seed),
                int(wildcards.ranks),
            ),
        ),
    script:
        "scripts/validate_cell.py"


rule judge_campaign:
    input:
        config=f"{RESULTS}/config.yaml",
        cells=below(campaign_study.CAMPAIGN, campaign_study.CAMPAIGN.measured(config)),
    output:
        json=f"{CAMPAIGN}/verdict.json",
        junit=f"{CAMPAIGN}/junit.xml",
    log:
        f"{LOGS}/campaign/verdict.log",
    localrule: True
    params:
        source=source("studies.campaign.scripts.judge_campaign"),
    script:
        "scripts/judge_campaign.py"
