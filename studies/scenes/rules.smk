# Scenes of designs and bars that fall, roll and strike each other, each with sound, film and page:
# `snakemake scenes`.
from studies.scenes import examples as scene_examples

SCENES_FOLDER = scene_examples.FOLDER
SCENES = f"{RESULTS}/{SCENES_FOLDER}"
PLAYED = scene_examples.scenes(config)
OF_SCENE = {key: f"{SCENES}/{{scene}}/{name}" for key, name in scene_examples.OUTPUTS.items()}


wildcard_constraints:
    scene="|".join(PLAYED),


rule write_scene:
    output:
        f"{SCENES}/{{scene}}/{scene_examples.SCENE}",
    log:
        f"{LOGS}/{SCENES_FOLDER}/{{scene}}/scene.log",
    localrule: True
    params:
        source=source("studies.base.scripts.write_yaml"),
        content=lambda wildcards: PLAYED[wildcards.scene].content,
    script:
        "../base/scripts/write_yaml.py"


# Timed, hence on all cores.
rule play_scene:
    input:
        scene=lambda wildcards: [
            f"{SCENES}/{wildcards.scene}/{name}" for name in PLAYED[wildcards.scene].files
        ],
        designs=lambda wildcards: [
            f"{SOUND}/{EXAMPLES[name].parts[-1]}/{DESIGN}"
            for name in PLAYED[wildcards.scene].designs
        ],
        page=scene_examples.PAGE_SOURCES,
    output:
        **OF_SCENE,
        told=f"{SCENES}/{{scene}}/{scene_examples.TOLD}",
    log:
        f"{LOGS}/{SCENES_FOLDER}/{{scene}}/play.log",
    benchmark:
        f"{BENCHMARKS}/{SCENES_FOLDER}/{{scene}}.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("play_scene"),
    params:
        source=source("studio.commands.scene"),
        scene=lambda wildcards: scene_examples.command(
            PLAYED[wildcards.scene], f"{SCENES}/{wildcards.scene}"
        ),
        outputs=lambda wildcards, output: options({key: str(output[key]) for key in OF_SCENE}),
    shell:
        "python -m studio scene {params.scene:q} {params.outputs:q}"
        " --json > {output.told:q}.partial 2> {log:q} && mv {output.told:q}.partial {output.told:q}"
