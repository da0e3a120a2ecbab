# Finite cells on thin curved walls: `snakemake thin_walls`.
from importlib.util import find_spec

from studies.thin_walls import catalogue as thin_wall_catalogue
from studies.thin_walls import study as thin_wall_study


# It takes all cores, although it uses one, since it times what it does.
rule measure_thin_walls:
    input:
        str(thin_wall_catalogue.REFERENCES),
    output:
        f"{place(thin_wall_study.THIN_WALLS)}/thin_walls.json",
    log:
        f"{LOGS}/thin_walls/thin_walls.log",
    benchmark:
        f"{BENCHMARKS}/thin_walls/thin_walls.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("measure_thin_walls"),
    params:
        source=source("studies.thin_walls.command"),
        how=thin_wall_study.arguments(config),
        others=[name for name in ("gmsh", "skfem") if find_spec(name)],
    shell:
        "python -m carillon study thin-walls {params.how:q} --out {output:q} > {log:q} 2>&1"


rule bound_thin_walls:
    input:
        str(thin_wall_catalogue.REFERENCES),
    output:
        f"{place(thin_wall_study.THIN_WALLS)}/bounds.json",
    log:
        f"{LOGS}/thin_walls/bounds.log",
    benchmark:
        f"{BENCHMARKS}/thin_walls/bounds.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("bound_thin_walls"),
    params:
        source=source("studies.thin_walls.bounds_command"),
        how=thin_wall_study.bound_arguments(config),
    shell:
        "python -m carillon study thin-wall-bounds {params.how:q} --out {output:q} > {log:q} 2>&1"
