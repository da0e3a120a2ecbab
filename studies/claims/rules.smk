# What the paper claims beside what is measured: `snakemake claims`, no part of the default run.
# It reads the tables of the run; those of `figures` and `scene_spectra` as well where they are there.
from studies.claims import study as claims_study
from workflow.report import study as report_study
from studies.claims.results import FULL, SCENE_PICTURE, SCENE_TABLE

READ_IF_THERE = [
    f"{RESULTS}/{path}"
    for path in (
        SCENE_TABLE,
        SCENE_PICTURE,
        *(f"{FULL}/tables/{name}.json" for name in ("methods", "convergence")),
    )
]


rule claims:
    input:
        f"{place(claims_study.CLAIMS)}/report.html",


rule build_claims:
    input:
        config=f"{RESULTS}/config.yaml",
        report=tables_in(report_study.REPORT),
        validation=expand(f"{VALIDATION}/tables/{{model}}-criteria.json", model=MODELS),
        others=[file for file in READ_IF_THERE if Path(file).is_file()],
        texts=[
            studies.FOLDER / "claims" / name
            for name in ("claims.yaml", "paper.yaml", "measured.json", "tables.yaml")
        ],
        templates=templates(claims_study.CLAIMS),
    output:
        f"{place(claims_study.CLAIMS)}/report.html",
        made=[
            f"{place(claims_study.CLAIMS)}/tables/{name}.json"
            for name in claims_study.CLAIMS.entries
        ],
    log:
        f"{LOGS}/{claims_study.CLAIMS.folder}/report.log",
    localrule: True
    params:
        source=made_with_tables(claims_study.CLAIMS),
        study=described(claims_study.CLAIMS, "tables", "page"),
    script:
        "../base/scripts/page.py"
