# How much of real recordings extraction finds: `snakemake recordings`, no part of the default run.
from studies.recordings import study as recordings_study
from studies.recordings import formats as recording_formats
from studies.recordings import recordings as recording_list
from studies.recordings import results as recording_results
from studies.recordings.recordings import PACKAGES

RECORDINGS_FOLDER = recording_list.FOLDER
RECORDINGS = f"{RESULTS}/{RECORDINGS_FOLDER}"
REAL = recording_list.recordings()
EXTRACTED = recording_results.EXTRACTED
EXTRACTION_START = f"{RECORDINGS}/{recording_results.START}"


wildcard_constraints:
    recording="|".join(REAL),


rule recordings:
    input:
        f"{RECORDINGS}/index.html",


# The one rule that needs a network, which nodes of a cluster may not have. The packages themselves are
# no output, which would be removed before the rule runs again.
rule bring_recordings:
    output:
        f"{RECORDINGS}/packages.txt",
    log:
        f"{LOGS}/{RECORDINGS_FOLDER}/packages.log",
    localrule: True
    params:
        source=source("studies.recordings.command"),
        folder=lambda wildcards, output: Path(output[0]).with_name(PACKAGES),
    shell:
        "python -m workflow recordings --out {params.folder:q} > {output:q}.partial 2> {log:q}"
        " && mv {output:q}.partial {output:q}"


rule time_extraction_start:
    output:
        EXTRACTION_START,
    log:
        f"{LOGS}/{RECORDINGS_FOLDER}/start.log",
    resources:
        **limits("time_extraction_start"),
    params:
        source=source("studies.recordings.scripts.time_extraction_start"),
    script:
        "scripts/time_extraction_start.py"


# A clip may be refused, so that its folder holds more or less.
rule extract_recording:
    input:
        rules.bring_recordings.output,
    output:
        directory(f"{RECORDINGS}/{{recording}}/{EXTRACTED}"),
    log:
        f"{LOGS}/{RECORDINGS_FOLDER}/{{recording}}/extract.log",
    resources:
        **limits("extract_recording"),
    params:
        source=source("studies.recordings.scripts.extract_recording", "sound.commands.extract"),
        clip=lambda wildcards: REAL[wildcards.recording].path(Path(RECORDINGS, PACKAGES)),
    script:
        "scripts/extract_recording.py"


rule compare_formats:
    input:
        extracted=f"{RECORDINGS}/{recording_formats.RECORDING}/{EXTRACTED}",
    output:
        f"{RECORDINGS}/{recording_formats.FORMATS}",
    log:
        f"{LOGS}/{RECORDINGS_FOLDER}/formats.log",
    resources:
        **limits("compare_formats"),
    params:
        source=source("studies.recordings.scripts.compare_formats", "sound.commands.extract"),
        clip=REAL[recording_formats.RECORDING].path(Path(RECORDINGS, PACKAGES)),
    script:
        "scripts/compare_formats.py"


rule build_recording_page:
    input:
        config=f"{RESULTS}/config.yaml",
        extracted=f"{RECORDINGS}/{{recording}}/{EXTRACTED}",
        start=EXTRACTION_START,
        templates=templates(recordings_study.RECORDINGS, "page.html.j2", "tables.yaml"),
    output:
        f"{RECORDINGS}/{{recording}}/page.html",
        provenance=f"{RECORDINGS}/{{recording}}/tables/provenance.json",
    log:
        f"{LOGS}/{RECORDINGS_FOLDER}/{{recording}}/page.log",
    localrule: True
    params:
        source=made_with_tables(recordings_study.RECORDING),
        study=described(recordings_study.RECORDING, "tables", "page"),
    script:
        "../base/scripts/page.py"


rule build_recordings_index:
    input:
        config=f"{RESULTS}/config.yaml",
        extracted=expand(f"{RECORDINGS}/{{recording}}/{EXTRACTED}", recording=REAL),
        start=EXTRACTION_START,
        formats=f"{RECORDINGS}/{recording_formats.FORMATS}",
        pages=expand(f"{RECORDINGS}/{{recording}}/page.html", recording=REAL),
        templates=templates(recordings_study.RECORDINGS, "index.html.j2", "index.yaml"),
    output:
        f"{RECORDINGS}/index.html",
        tables=[f"{RECORDINGS}/tables/{name}.json" for name in recordings_study.RECORDINGS.entries],
    log:
        f"{LOGS}/{RECORDINGS_FOLDER}/index.log",
    localrule: True
    params:
        source=made_with_tables(recordings_study.RECORDINGS),
        study=described(recordings_study.RECORDINGS, "tables", "page"),
    script:
        "../base/scripts/page.py"
