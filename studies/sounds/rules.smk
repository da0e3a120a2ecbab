# Examples of sound design, from clips to a material to sounds: `snakemake sounds`, no part of the
# default run.
from studies.sounds import study as sounds_study


include: "examples.smk"


rule synthesise_clip:
    output:
        f"{SOUND}/{{example}}/clips/{{point}}.wav",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/clip-{{point}}.log",
    wildcard_constraints:
        example=only(SYNTHESISED),
    resources:
        **limits("synthesise_clip"),
    params:
        source=source("sound.commands.clip"),
        how=lambda wildcards: targets_of(wildcards)[wildcards.point].clip.split(),
    shell:
        "python -m sound clip {params.how:q} --out {output:q} > {log:q} 2>&1"


# Of several channels the one that is searched.
rule take_recording:
    input:
        f"{RECORDINGS}/packages.txt",
    output:
        f"{SOUND}/{{example}}/clips/{{point}}.wav",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/clip-{{point}}.log",
    wildcard_constraints:
        example=only(OF_RECORDINGS),
    localrule: True
    params:
        source=source("studies.sounds.scripts.take_recording"),
        recording=clip_file,
    script:
        "scripts/take_recording.py"


rule check_design:
    input:
        mesh=mesh_files,
        young=f"{SOUND}/{{example}}/young.npy",
    output:
        f"{SOUND}/{{example}}/{TRUTH}",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/truth.log",
    threads: SOLVER_CORES
    resources:
        **limits("check_design"),
    params:
        source=source("solver.commands.modes"),
        solid=lambda wildcards: sound_examples.solid_arguments(EXAMPLES[wildcards.example]),
    shell:
        "python -m solver modes {params.solid:q} --material {input.young:q} --coarsen none"
        " --method slepc --no-estimate --out {output:q} > {log:q} 2>&1"


rule save_recorded_moduli:
    output:
        f"{SOUND}/{{example}}/recorded.npy",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/recorded-young.log",
    wildcard_constraints:
        example=only(RECORDED),
    localrule: True
    params:
        source=source("studies.sounds.scripts.save_recorded_moduli"),
        example=recording_of,
    script:
        "scripts/save_recorded_moduli.py"


use rule check_design as find_recorded_modes with:
    input:
        mesh=mesh_files,
        young=f"{SOUND}/{{example}}/recorded.npy",
    output:
        f"{SOUND}/{{example}}/recorded.h5",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/recorded.log",


rule write_project:
    output:
        f"{SOUND}/{{part}}/{PROJECT}",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{part}}/project.log",
    wildcard_constraints:
        part=only(part for name in DESCRIBED for part in EXAMPLES[name].parts),
    localrule: True
    params:
        source=source("studies.base.scripts.write_yaml"),
        content=lambda wildcards: sound_examples.project(
            example_of(wildcards), wildcards.part, config
        ),
    script:
        "../base/scripts/write_yaml.py"


rule init_project:
    input:
        example_clips,
    output:
        f"{SOUND}/{{example}}/{PROJECT}",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/project.log",
    wildcard_constraints:
        example=only(BY_DEFAULT),
    resources:
        **limits("init_project"),
    params:
        source=source("sound.commands.init"),
        mesh=lambda wildcards: EXAMPLES[wildcards.example].mesh,
    shell:
        "python -m sound init {output:q} --mesh {params.mesh:q} --clips {input:q} > {log:q} 2>&1"


# A single evaluation is that of the uniform material.
rule begin_design:
    input:
        project=f"{SOUND}/{{example}}/{PROJECT}",
        mesh=mesh_files,
        clips=example_clips,
        forests=settings.forest_files(),
    output:
        f"{SOUND}/{{example}}/{START}",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/start.log",
    threads: SOLVER_CORES
    resources:
        **limits("begin_design"),
    params:
        source=source("sound.commands.design"),
        how=options({"evaluations": 1}),
    shell:
        "python -m sound design {input.project:q} {params.how:q} --out {output:q} > {log:q} 2>&1"


# The search takes all cores, since what it finds depends on how much it evaluates in its time.
use rule begin_design as design_sound with:
    input:
        project=f"{SOUND}/{{part}}/{PROJECT}",
        mesh=lambda wildcards: example_of(wildcards).mesh_files,
        clips=part_clips,
        before=design_before,
        forests=settings.forest_files(),
    output:
        f"{SOUND}/{{part}}/{DESIGN}",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{part}}/design.log",
    benchmark:
        f"{BENCHMARKS}/{SOUND_FOLDER}/{{part}}/design.tsv"
    resources:
        **limits("design_sound"),
    params:
        source=source("sound.commands.design"),
        how=search_options,


rule compare_optimisers:
    input:
        project=f"{SOUND}/{{example}}/{PROJECT}",
        mesh=mesh_files,
        clips=example_clips,
        forests=settings.forest_files(),
    output:
        f"{SOUND}/{{example}}/optimisers.json",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/optimisers.log",
    benchmark:
        f"{BENCHMARKS}/{SOUND_FOLDER}/{{example}}/optimisers.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("compare_optimisers"),
    params:
        source=source("studies.design.command"),
        how=options({"seconds": config["sound"]["compare_seconds"]}),
    shell:
        "python -m carillon study benchmark-design {input.project:q} {params.how:q}"
        " --json > {output:q}.partial 2> {log:q} && mv {output:q}.partial {output:q}"


# Solids that have what is sought, by several seeds and with checks: no part of `sounds`, as it takes an
# hour.
use rule compare_optimisers as compare_optimisers_by_seeds with:
    output:
        f"{SOUND}/{{example}}/{COMPARISON}",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/comparison.log",
    benchmark:
        f"{BENCHMARKS}/{SOUND_FOLDER}/{{example}}/comparison.tsv"
    wildcard_constraints:
        example=only(RECORDED),
    params:
        source=source("studies.design.command"),
        how=options(
            {
                "seconds": config["sound"]["compare_seconds"],
                "seeds": config["sound"]["compare_seeds"],
            }
        )
        + ["--fine-check"],


rule find_reach:
    input:
        project=f"{SOUND}/{{example}}/{PROJECT}",
        design=f"{SOUND}/{{example}}/{DESIGN}",
        mesh=mesh_files,
        clips=example_clips,
        forests=settings.forest_files(),
    output:
        f"{SOUND}/{{example}}/{REACHED}",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/reach.log",
    threads: SOLVER_CORES
    resources:
        **limits("find_reach"),
    params:
        source=source("sound.commands.reach"),
        how=options(
            {
                "seconds": config["sound"]["reach_seconds"],
                "unless_fall": sound_examples.SATISFYING_FALL,
            }
        ),
    shell:
        "python -m sound reach {input.project:q} {input.design:q} {params.how:q}"
        " --json > {output:q}.partial 2> {log:q} && mv {output:q}.partial {output:q}"


rule save_moduli:
    input:
        design=f"{SOUND}/{{example}}/{DESIGN}",
    output:
        f"{SOUND}/{{example}}/young.npy",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/young.log",
    localrule: True
    params:
        source=source("sound.commands.export"),
    shell:
        "python -m sound export {input.design:q} --out {output:q} > {log:q} 2>&1"


rule render_before:
    input:
        f"{SOUND}/{{example}}/{START}",
    output:
        sound=f"{SOUND}/{{example}}/before/{{point}}.wav",
        modes=f"{SOUND}/{{example}}/before/modes/{{point}}.wav",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/before-{{point}}.log",
    resources:
        **limits("render_before"),
    params:
        source=source("sound.commands.render"),
        how=sound_arguments,
    shell:
        "python -m sound render {input:q} {params.how:q} --out {output.sound:q} > {log:q} 2>&1"


use rule render_before as record_clip with:
    input:
        f"{SOUND}/{{example}}/recorded.h5",
    output:
        sound=f"{SOUND}/{{example}}/clips/{{point}}.wav",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/clip-{{point}}.log",
    wildcard_constraints:
        example=only(RECORDED),
    resources:
        **limits("record_clip"),
    params:
        source=source("sound.commands.render"),
        how=strike_of_recording,


use rule render_before as render_after with:
    input:
        f"{SOUND}/{{example}}/{DESIGN}",
    output:
        sound=f"{SOUND}/{{example}}/after/{{point}}.wav",
        modes=f"{SOUND}/{{example}}/after/modes/{{point}}.wav",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/after-{{point}}.log",


rule render_fine:
    input:
        truth=f"{SOUND}/{{example}}/{TRUTH}",
        design=f"{SOUND}/{{example}}/{DESIGN}",
    output:
        sound=f"{SOUND}/{{example}}/fine/{{point}}.wav",
        modes=f"{SOUND}/{{example}}/fine/modes/{{point}}.wav",
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/fine-{{point}}.log",
    resources:
        **limits("render_fine"),
    params:
        source=source("sound.commands.render"),
        how=sound_arguments,
    shell:
        "python -m sound render {input.truth:q} --like {input.design:q} {params.how:q}"
        " --out {output.sound:q} > {log:q} 2>&1"


rule build_sound_page:
    input:
        config=f"{RESULTS}/config.yaml",
        designs=example_designs,
        start=f"{SOUND}/{{example}}/{START}",
        truth=f"{SOUND}/{{example}}/{TRUTH}",
        sounds=all_sounds,
        optimisers=comparison,
        reached=reached,
    output:
        f"{SOUND}/{{example}}/page.html",
        tables_in(sounds_study.SOUND, *sounds_study.READ),
    log:
        f"{LOGS}/{SOUND_FOLDER}/{{example}}/page.log",
    localrule: True
    params:
        **made_with_tables(sounds_study.SOUND),
    script:
        "../base/scripts/page.py"
