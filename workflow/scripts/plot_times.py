"""Plot the wall times of all models."""

from workflow.report.plots import times_figure
from workflow.report.style import save
from workflow.report.table import read_table

save(times_figure(read_table(snakemake.input.times)), snakemake.output)
