"""Draw one model's mode and spectrum against the ground truth, as one picture."""

from workflow.report.overview import overview_figure
from workflow.report.results import results_beside
from workflow.report.style import save_png
from workflow.report.table import read_table

figure = overview_figure(
    results_beside(snakemake.input.config),
    read_table(snakemake.input.frequencies),
    snakemake.wildcards.model,
)
save_png(figure, snakemake.output[0])
