# One scene of rigid bodies, heard by the truth's modes and by coarse ones (Fig. 13 of the paper):
# `snakemake scene_spectra`, no part of the default run.
from workflow.studies.scene_spectra import scene as spectra_scene

SPECTRA_FOLDER = "scene_spectra"
SPECTRA = f"{RESULTS}/{SPECTRA_FOLDER}"


wildcard_constraints:
    heard="|".join(spectra_scene.RENDERINGS),
    body="|".join(spectra_scene.BODIES),


rule scene_spectra:
    input:
        f"{RESULTS}/scene-spectra.html",


# The forests are those of the package.
rule find_modes_of_body:
    input:
        forests=settings.forest_files(),
    output:
        f"{SPECTRA}/{spectra_scene.modes_file('{body}', '{heard}')}",
    log:
        f"{LOGS}/{SPECTRA_FOLDER}/{{body}}-{{heard}}.log",
    benchmark:
        f"{BENCHMARKS}/{SPECTRA_FOLDER}/{{body}}-{{heard}}.tsv"
    threads: RUN_CORES
    resources:
        **limits("find_modes", ranks=RANKS, cores=RUN_CORES),
    params:
        source=source("solver.commands.modes"),
        how=lambda wildcards: spectra_scene.modes_arguments(config, *wildcards),
    shell:
        solver_command("modes {params.how:q}")


rule write_heard_scene:
    output:
        f"{SPECTRA}/{{heard}}/{spectra_scene.SCENE}",
    log:
        f"{LOGS}/{SPECTRA_FOLDER}/{{heard}}/scene.log",
    localrule: True
    params:
        source=source("workflow.scripts.write_yaml"),
        content=lambda wildcards: spectra_scene.scene_of(config, wildcards.heard),
    script:
        "../scripts/write_yaml.py"


rule hear_scene:
    input:
        scene=rules.write_heard_scene.output,
        modes=lambda wildcards: [
            f"{SPECTRA}/{spectra_scene.modes_file(body, heard)}"
            for body in spectra_scene.BODIES
            for heard in dict.fromkeys((variants.TRUTH, wildcards.heard))
        ],
    output:
        sound=f"{SPECTRA}/{{heard}}/{spectra_scene.SOUND}",
        told=f"{SPECTRA}/{{heard}}/{spectra_scene.TOLD}",
    log:
        f"{LOGS}/{SPECTRA_FOLDER}/{{heard}}/hear.log",
    benchmark:
        f"{BENCHMARKS}/{SPECTRA_FOLDER}/{{heard}}.tsv"
    resources:
        **limits("play_scene"),
    params:
        source=source("studio.commands.scene"),
    shell:
        "python -m studio scene {input.scene:q} --out {output.sound:q}"
        " --json > {output.told:q}.partial 2> {log:q} && mv {output.told:q}.partial {output.told:q}"


rule tabulate_scene_spectra:
    input:
        config=f"{RESULTS}/config.yaml",
        found=expand(rules.hear_scene.output, heard=spectra_scene.RENDERINGS),
        described=descriptions(catalogue.SCENE_SPECTRA),
    output:
        marks.tables(catalogue.SCENE_SPECTRA, RESULTS),
    log:
        f"{LOGS}/{SPECTRA_FOLDER}/tables.log",
    localrule: True
    params:
        source=made_by(
            "tabulate", catalogue.SCENE_SPECTRA.results, *catalogue.SCENE_SPECTRA.table_modules
        ),
        study=told(catalogue.SCENE_SPECTRA, "tables"),
    script:
        "../scripts/tabulate.py"


for figure in catalogue.SCENE_SPECTRA.figures:

    rule:
        name:
            f"plot_scene_{figure.name.replace('-', '_')}"
        input:
            config=f"{RESULTS}/config.yaml",
            found=f"{RESULTS}/{figure.needs}",
        output:
            marks.figure(catalogue.SCENE_SPECTRA, figure, RESULTS),
        log:
            f"{LOGS}/{SPECTRA_FOLDER}/{figure.file}.log",
        localrule: True
        params:
            source=made_by("plot", catalogue.SCENE_SPECTRA.results, figure.draw),
            study=told(catalogue.SCENE_SPECTRA),
            draw=figure.draw,
        script:
            "../scripts/plot.py"


rule build_scene_spectra:
    input:
        config=f"{RESULTS}/config.yaml",
        tables=tables_in(catalogue.SCENE_SPECTRA),
        figures=figures_of(catalogue.SCENE_SPECTRA),
        templates=templates(SPECTRA_FOLDER),
    output:
        marks.page(
            catalogue.SCENE_SPECTRA, f"{RESULTS}/scene-spectra.html", "Scenes", scene="Fig. 13"
        ),
    log:
        f"{LOGS}/{SPECTRA_FOLDER}/page.log",
    localrule: True
    params:
        source=made_by("page", catalogue.SCENE_SPECTRA.results, catalogue.SCENE_SPECTRA.page),
        study=told(catalogue.SCENE_SPECTRA, "page"),
    script:
        "../scripts/page.py"
