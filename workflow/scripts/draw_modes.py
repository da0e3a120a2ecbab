"""Draw the first elastic mode of one model by every variant that is shown."""

import json

from carillon.files import atomic_path
from workflow.report.mode_pictures import draw_first_elastic_modes
from workflow.report.results import results_beside

description = draw_first_elastic_modes(
    results_beside(snakemake.input.config), snakemake.wildcards.model, snakemake.output.pictures
)
with atomic_path(snakemake.output.description) as temporary:
    temporary.write_text(json.dumps(description, indent=1))
