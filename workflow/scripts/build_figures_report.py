"""Put tables and plots of the figures into one self-contained page."""

from carillon.files import atomic_path
from workflow.figures.page import render
from workflow.figures.results import figures_beside

with atomic_path(snakemake.output[0]) as temporary:
    temporary.write_text(render(figures_beside(snakemake.input.config)), encoding="utf-8")
