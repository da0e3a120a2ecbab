# One scene of rigid bodies, heard by the truth's modes and by coarse ones (Fig. 13 of the paper):
# `snakemake scene_spectra`, no part of the default run.
from studies.scene_spectra import study as scene_spectra_study
from studies.scene_spectra import scene as spectra_scene

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
        source=source("studies.base.scripts.write_yaml"),
        content=lambda wildcards: spectra_scene.scene_of(config, wildcards.heard),
    script:
        "../base/scripts/write_yaml.py"


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
        described=descriptions(
            scene_spectra_study.SCENE_SPECTRA.package, scene_spectra_study.SCENE_SPECTRA.tables
        ),
    output:
        expand(
            f"{RESULTS}/tables/{{name}}.{{kind}}",
            name=scene_spectra_study.SCENE_SPECTRA.entries,
            kind=("csv", "md", "json"),
        ),
    log:
        f"{LOGS}/{SPECTRA_FOLDER}/tables.log",
    localrule: True
    params:
        source=source(
            "studies.base.scripts.tabulate",
            scene_spectra_study.SCENE_SPECTRA.module(scene_spectra_study.SCENE_SPECTRA.results),
            *scene_spectra_study.SCENE_SPECTRA.table_modules,
        ),
        study=described(scene_spectra_study.SCENE_SPECTRA, "tables"),
    script:
        "../base/scripts/tabulate.py"


for figure in scene_spectra_study.SCENE_SPECTRA.figures:

    rule:
        name:
            f"plot_scene_{figure.name.replace('-', '_')}"
        input:
            config=f"{RESULTS}/config.yaml",
            found=f"{RESULTS}/{figure.needs}",
        output:
            expand(
                f"{RESULTS}/figures/{figure.file}.{{kind}}",
                kind=("svg", "png"),
                allow_missing=True,
            ),
        log:
            f"{LOGS}/{SPECTRA_FOLDER}/{figure.file}.log",
        localrule: True
        params:
            source=made_by(
                "plot",
                scene_spectra_study.SCENE_SPECTRA,
                scene_spectra_study.SCENE_SPECTRA.results,
                figure.draw,
            ),
            study=described(scene_spectra_study.SCENE_SPECTRA),
            draw=figure.draw,
        script:
            "../base/scripts/plot.py"


rule build_scene_spectra:
    input:
        config=f"{RESULTS}/config.yaml",
        tables=tables_in(scene_spectra_study.SCENE_SPECTRA),
        figures=figures_of(scene_spectra_study.SCENE_SPECTRA),
        templates=templates(scene_spectra_study.SCENE_SPECTRA),
    output:
        f"{RESULTS}/scene-spectra.html",
    log:
        f"{LOGS}/{SPECTRA_FOLDER}/page.log",
    localrule: True
    params:
        source=made_by(
            "page",
            scene_spectra_study.SCENE_SPECTRA,
            scene_spectra_study.SCENE_SPECTRA.results,
            scene_spectra_study.SCENE_SPECTRA.page,
        ),
        study=described(scene_spectra_study.SCENE_SPECTRA, "page"),
    script:
        "../base/scripts/page.py"
