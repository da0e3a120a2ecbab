# The fastest method by unknowns, modes, ranks and tolerance: `snakemake crossover`.
from dataclasses import asdict

from studies.crossover import cases as crossover_cases
from studies.crossover import study as crossover_study


# It takes all cores, since it times what it does; a run that fails is a result as well.
rule measure_crossover:
    input:
        lambda wildcards: solids.mesh_files(config, "crossover", wildcards.solid),
    output:
        f"{place(crossover_study.CROSSOVER)}/cases/{{solid}}/{{resolution}}-{{launch}}.json",
    log:
        f"{LOGS}/crossover/{{solid}}/{{resolution}}-{{launch}}.log",
    benchmark:
        f"{BENCHMARKS}/crossover/{{solid}}/{{resolution}}-{{launch}}.tsv"
    wildcard_constraints:
        launch=r"\d+-on-[^/]+",
    threads: SOLVER_CORES
    resources:
        **limits("measure_crossover"),
    params:
        source=source("studies.crossover.scripts.measure_case", "solver.commands.modes"),
        solid=lambda wildcards, output: crossover_cases.solid_arguments(
            config, crossover_cases.case_at(config, output[0])
        ),
        launch=lambda wildcards, output: asdict(crossover_cases.case_at(config, output[0]).launch),
        part=crossover_study.measured_part(config),
    script:
        "scripts/measure_case.py"
