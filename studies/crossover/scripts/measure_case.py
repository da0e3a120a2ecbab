"""Measure one case of the crossover."""

import json
from pathlib import Path

from carillon.files.atomic import atomic_path
from carillon.parameters.documents import parameters_from
from carillon.records.measurement import measured
from studies.base.study import logged
from studies.crossover.config import Launch
from studies.crossover.measure import Runner, measure_case

output, given = Path(snakemake.output[0]), snakemake.params
with logged(snakemake.log):
    launch = parameters_from(given.launch, Launch)
    runner = Runner(launch, snakemake.threads, given.part["seconds"], output.parent)
    rows = measure_case(runner, given.solid, given.part)
    about = {"solid": given.solid, **given.launch}
    result = {
        "runs": rows,
        "provenance": measured(about, launch.ranks, launch.threads_of(snakemake.threads)),
    }
    with atomic_path(output) as temporary:
        temporary.write_text(json.dumps(result, indent=1))
