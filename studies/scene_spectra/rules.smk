# One scene of rigid bodies, heard by the truth's modes and by coarse ones (Fig. 13 of the paper):
# `snakemake scene_spectra`.
from studies.scene_spectra import scene as spectra_scene

SPECTRA_FOLDER = spectra_scene.FOLDER
SPECTRA = f"{RESULTS}/{SPECTRA_FOLDER}"


wildcard_constraints:
    heard="|".join(spectra_scene.RENDERINGS),
    body="|".join(spectra_scene.BODIES),


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
