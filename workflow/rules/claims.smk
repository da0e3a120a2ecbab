# What the paper claims beside what is measured: `snakemake claims`, no part of the default run.
# It reads the tables of the run; those of `figures` and `scene_spectra` as well where they are there.
from workflow.studies.claims.results import FULL, SCENE_PICTURE, SCENE_TABLE

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
        f"{place(catalogue.CLAIMS)}/report.html",


rule build_claims:
    input:
        config=f"{RESULTS}/config.yaml",
        report=tables_in(catalogue.REPORT),
        validation=expand(f"{VALIDATION}/tables/{{model}}-criteria.json", model=MODELS),
        others=[file for file in READ_IF_THERE if Path(file).is_file()],
        texts=[
            settings.FOLDER / "studies/claims" / name
            for name in ("claims.yaml", "paper.yaml", "measured.json", "tables.yaml")
        ],
        templates=templates("claims"),
    output:
        marks.page(catalogue.CLAIMS, f"{place(catalogue.CLAIMS)}/report.html"),
        made=[f"{place(catalogue.CLAIMS)}/tables/{name}.json" for name in catalogue.CLAIMS.entries],
    log:
        f"{LOGS}/{catalogue.CLAIMS.folder}/report.log",
    localrule: True
    params:
        source=made_by("page", *pages_of(catalogue.CLAIMS)),
        study=told(catalogue.CLAIMS, "tables", "page"),
    script:
        "../scripts/page.py"
