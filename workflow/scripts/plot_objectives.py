"""Plot the frequency errors of one solid by objective."""

from workflow.report.style import save
from workflow.report.table import read_table
from workflow.study.cases import study_beside
from workflow.study.goals import rms_limits
from workflow.study.plots import errors_figure

solid = snakemake.wildcards.solid
limits = rms_limits(study_beside(snakemake.input.config), solid)
save(errors_figure(read_table(snakemake.input.errors), solid, limits), snakemake.output)
