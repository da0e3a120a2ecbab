"""Plot frequencies and their errors of one model."""

from workflow.report.plots import spectrum_figure
from workflow.report.style import save
from workflow.report.table import read_table

figure = spectrum_figure(read_table(snakemake.input.frequencies), snakemake.wildcards.model)
save(figure, snakemake.output)
