"""Plot how the eigenvalues of one model approach the truth."""

import json
from pathlib import Path

from solver.modes_file import read_modes
from workflow.report.plots import convergence_figure
from workflow.report.style import save

history = json.loads(Path(snakemake.input.history).read_text())
truth = read_modes(snakemake.input.truth, with_modes=False)
save(convergence_figure(history, truth.eigenvalues), snakemake.output)
