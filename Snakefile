# Training data -> forests -> spectra of every model -> tables -> results/report.html
import shutil
from pathlib import Path

from snakemake.utils import min_version

from carillon.errors import UserError
from carillon.command_line.progress import say
import studies
from workflow import disk_space, patient_slurm, pinned_meshes, settings, slurm_cleanup
from workflow import slurm_watch, submission
from workflow.estimate import used

min_version("9.0")

# This file is also in the folder of the rules, where an installed Carillon has it.
RULES = settings.FOLDER / "rules"


# A configuration file on the command line takes the place of the default one, it does not extend it:
# otherwise the default models could not be left out.
if not workflow.overwrite_configfiles:

    configfile: str(settings.FOLDER / "config" / "laptop.yaml")


try:
    given = workflow.configfiles, workflow.config_settings.config
    config = settings.complete(*given)
    settings.check_files(config, *given)
    rules_of_studies = studies.rules()
except UserError as error:
    raise WorkflowError(str(error)) from None


include: f"{RULES}/common.smk"
include: f"{RULES}/dataset.smk"
include: f"{RULES}/forests.smk"
include: f"{RULES}/model.smk"
include: f"{RULES}/spectra.smk"
include: f"{RULES}/default_forest.smk"
include: f"{studies.FOLDER}/base/catalogue.smk"
include: f"{RULES}/validation.smk"
include: f"{RULES}/report.smk"


# A study is a folder, its rules as well.
for rules_of_study in rules_of_studies:

    include: str(rules_of_study)


include: f"{studies.FOLDER}/base/rules.smk"


# What happens to the jobs of SLURM, in a run on a cluster.
WATCH = []


onstart:
    if not workflow.local_exec:
        if shutil.which("sbatch"):
            prepend("PATH", patient_slurm.install())
            WATCH.append(slurm_watch.Watch(patient_slurm.FOLDER))
            WATCH[0].start()
        places = [workflow.main_snakefile, Path.cwd(), *workflow.overwrite_configfiles]
        try:
            submission.require_plain(places, workflow.config_settings.config)
        except UserError as error:
            raise WorkflowError(str(error)) from None
    for sentence in pinned_meshes.of_run(config):
        say(sentence)
    if ALONE:
        slurm_cleanup.cancel(Path.cwd())


onsuccess:
    for watch in WATCH:
        watch.tell()
    used.tell(workflow, config, RESULTS)


onerror:
    for watch in WATCH:
        watch.tell()
    disk_space.check_disk(RESULTS)
    used.tell(workflow, config, RESULTS)


rule all:
    default_target: True
    input:
        f"{RESULTS}/report.html",
        expand(f"{RESULTS}/figures/{{model}}-overview.png", model=MODELS),
        expand(f"{RESULTS}/validation/{{model}}.html", model=MODELS),
