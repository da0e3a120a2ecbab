# Training data -> forests -> spectra of every model -> tables -> results/report.html
import shutil
from pathlib import Path

from snakemake.utils import min_version, validate

from carillon.errors import UserError
from carillon.progress import say
from workflow import orphans, patient_slurm, pinned_meshes, room, settings, submission

min_version("9.0")

# This file is also in the folder of the rules, where an installed Carillon has it.
RULES = settings.FOLDER / "rules"


# A configuration file on the command line takes the place of the default one, it does not extend it:
# otherwise the default models could not be left out.
if not workflow.overwrite_configfiles:

    configfile: str(settings.FOLDER / "config" / "laptop.yaml")


try:
    config = settings.read(workflow.configfiles, workflow.config_settings.config)
    settings.check(config)
    validate(config, schema=str(settings.SCHEMA))
    settings.check_links(config)
except UserError as error:
    raise WorkflowError(str(error)) from None


report: f"{settings.FOLDER}/studies/captions/workflow.rst"


include: f"{RULES}/common.smk"
include: f"{RULES}/dataset.smk"
include: f"{RULES}/forests.smk"
include: f"{RULES}/model.smk"
include: f"{RULES}/spectra.smk"
include: f"{RULES}/catalogue.smk"
include: f"{RULES}/studies.smk"
include: f"{RULES}/validation.smk"
include: f"{RULES}/figures.smk"
include: f"{RULES}/claims.smk"
include: f"{RULES}/scaling.smk"
include: f"{RULES}/objectives.smk"
include: f"{RULES}/coarsening.smk"
include: f"{RULES}/discretisation.smk"
include: f"{RULES}/accuracy.smk"
include: f"{RULES}/campaign.smk"
include: f"{RULES}/default_forest.smk"
include: f"{RULES}/forests_study.smk"
include: f"{RULES}/recordings.smk"
include: f"{RULES}/examples.smk"
include: f"{RULES}/sound.smk"
include: f"{RULES}/scenes.smk"
include: f"{RULES}/scene_spectra.smk"
include: f"{RULES}/compare.smk"


onstart:
    if not workflow.local_exec:
        if shutil.which("sbatch"):
            prepend("PATH", patient_slurm.install())
        places = [workflow.main_snakefile, Path.cwd(), *workflow.overwrite_configfiles]
        try:
            submission.require_plain(places, workflow.config_settings.config)
        except UserError as error:
            raise WorkflowError(str(error)) from None
    for sentence in pinned_meshes.of_run(config):
        say(sentence)
    if ALONE:
        orphans.cancel(Path.cwd())


onerror:
    room.check_disk(RESULTS)


rule all:
    default_target: True
    input:
        f"{RESULTS}/report.html",
        expand(f"{RESULTS}/figures/{{model}}-overview.png", model=MODELS),
        expand(f"{RESULTS}/validation/{{model}}.html", model=MODELS),
