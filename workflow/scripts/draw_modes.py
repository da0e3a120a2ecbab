"""Draw the first elastic mode of one model by every variant that is shown."""

import json
from pathlib import Path

from carillon.files import atomic_path
from workflow.studies.base.study import logged
from workflow.studies.report.mode_pictures import draw_first_elastic_modes
from workflow.studies.report.results import Run

with logged(snakemake.log):
    run, pictures = Run(Path(snakemake.input.config).parent), snakemake.output.pictures
    description = draw_first_elastic_modes(run, snakemake.wildcards.model, pictures)
    with atomic_path(snakemake.output.description) as temporary:
        temporary.write_text(json.dumps(description, indent=1))
