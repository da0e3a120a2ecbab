"""Draw the first elastic mode of one model by every variant that is shown."""

import json
from pathlib import Path

from carillon.files.atomic import atomic_path
from studies.base.study import logged
from workflow.report.mode_pictures import draw_first_elastic_modes
from workflow.report.results import Run

with logged(snakemake.log):
    run, pictures = Run(Path(snakemake.input.config).parent), snakemake.output.pictures
    description = draw_first_elastic_modes(run, snakemake.wildcards.model, pictures)
    with atomic_path(snakemake.output.description) as temporary:
        temporary.write_text(json.dumps(description, indent=1))
