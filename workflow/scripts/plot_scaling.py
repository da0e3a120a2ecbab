"""Plot measured and modelled wall times over the number of ranks."""

import json
from pathlib import Path

from solver.studies.scaling.plot import scaling_figure
from workflow.report.style import SETTINGS, save

scaling = json.loads(Path(snakemake.input.scaling).read_text())
save(scaling_figure(scaling, SETTINGS), snakemake.output)
