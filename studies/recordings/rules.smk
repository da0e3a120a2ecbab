# How much of real recordings extraction finds: `snakemake recordings`.
from studies.recordings import study as recordings_study
from studies.recordings import formats as recording_formats
from studies.recordings import recordings as recording_list
from studies.recordings.recordings import PACKAGES

RECORDINGS_FOLDER = recording_list.FOLDER
RECORDINGS = f"{RESULTS}/{RECORDINGS_FOLDER}"
REAL = recording_list.recordings()
EXTRACTED = recording_list.EXTRACTED
EXTRACTION_START = f"{RECORDINGS}/{recording_list.START}"


wildcard_constraints:
    recording="|".join(REAL),


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
        "python -m carillon study recordings --out {params.folder:q} > {output:q}.partial 2> {log:q}"
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
        f"{RECORDINGS}/{recording_list.FORMATS}",
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
    output:
        f"{RECORDINGS}/{{recording}}/page.html",
        tables_in(recordings_study.RECORDING, "provenance"),
    log:
        f"{LOGS}/{RECORDINGS_FOLDER}/{{recording}}/page.log",
    localrule: True
    params:
        **made_with_tables(recordings_study.RECORDING),
    script:
        "../base/scripts/page.py"
