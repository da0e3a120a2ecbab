# Training data -> forests -> spectra of every model -> tables -> results/report.html
from pathlib import Path

from snakemake.utils import min_version, validate

from carillon.errors import UserError
from workflow import orphans, room, settings, submission

min_version("9.0")


# A configuration file on the command line takes the place of the default one, it does not extend it:
# otherwise the default models could not be left out.
if not workflow.overwrite_configfiles:

    configfile: str(Path(workflow.basedir, "workflow/config/laptop.yaml"))


try:
    config = settings.read(workflow.configfiles, workflow.config_settings.config)
    settings.check(config)
    validate(config, schema="workflow/schemas/config.schema.yaml")
    settings.check_links(config)
except UserError as error:
    raise WorkflowError(str(error)) from None


report: "workflow/report/captions/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/dataset.smk"
include: "workflow/rules/forests.smk"
include: "workflow/rules/model.smk"
include: "workflow/rules/spectra.smk"
include: "workflow/rules/tables.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/validation.smk"
include: "workflow/rules/shapes.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/scaling.smk"
include: "workflow/rules/study.smk"
include: "workflow/rules/objectives.smk"
include: "workflow/rules/default_forest.smk"
include: "workflow/rules/forests_study.smk"
include: "workflow/rules/examples.smk"
include: "workflow/rules/sound.smk"
include: "workflow/rules/compare.smk"


onstart:
    if not workflow.local_exec:
        places = [workflow.main_snakefile, Path.cwd(), *workflow.overwrite_configfiles]
        try:
            submission.require_plain(places, workflow.config_settings.config)
        except UserError as error:
            raise WorkflowError(str(error)) from None
    if ALONE:
        orphans.cancel(Path.cwd())


onerror:
    room.tell_if_full(RESULTS)


rule all:
    default_target: True
    input:
        f"{RESULTS}/report.html",
        expand(f"{RESULTS}/figures/{{model}}-overview.png", model=MODELS),
        expand(f"{RESULTS}/validation/{{model}}.html", model=MODELS),
