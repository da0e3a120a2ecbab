"""Plot one figure of the study of the forests."""

from workflow.forests_study.plots import FIGURES
from workflow.forests_study.results import study_beside
from workflow.report.style import save

figure = FIGURES[snakemake.wildcards.figure](study_beside(snakemake.input.config))
save(figure, snakemake.output)
