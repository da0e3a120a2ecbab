"""Plot the wall times of all methods."""

from workflow.report.methods_plot import methods_figure
from workflow.report.style import save
from workflow.report.table import read_table

save(methods_figure(read_table(snakemake.input.methods)), snakemake.output)
