"""Put tables and figures of the study of the forests into one self-contained page."""

from carillon.files import atomic_path
from workflow.forests_study.page import render
from workflow.forests_study.results import study_beside

with atomic_path(snakemake.output[0]) as temporary:
    temporary.write_text(render(study_beside(snakemake.input.config)), encoding="utf-8")
