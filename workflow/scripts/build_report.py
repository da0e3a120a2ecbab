"""Put tables and figures into one self-contained page."""

from carillon.files import atomic_path
from workflow.report.page import render
from workflow.report.results import results_beside

with atomic_path(snakemake.output[0]) as temporary:
    temporary.write_text(render(results_beside(snakemake.input.config)), encoding="utf-8")
