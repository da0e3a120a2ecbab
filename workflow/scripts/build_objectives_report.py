"""Put tables and figures of the objectives' study into one self-contained page."""

from carillon.files import atomic_path
from workflow.study.cases import study_beside
from workflow.study.page import render

with atomic_path(snakemake.output[0]) as temporary:
    temporary.write_text(render(study_beside(snakemake.input.config)), encoding="utf-8")
