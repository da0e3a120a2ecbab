"""Plot how the eigenvalues of one model approach the truth."""

import json
from pathlib import Path

from workflow.report.convergence_plot import convergence_figure
from workflow.report.style import save

history = json.loads(Path(snakemake.input.history).read_text())
save(convergence_figure(history), snakemake.output)
