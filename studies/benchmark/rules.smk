# Wall times of every way to a spectrum, in the report of the run.
LEAST_RESOLUTION = 4


def timed_resolution(wildcards):
    """Resolution at which a model is timed."""
    part, own = config["times"], config["models"][wildcards.model]["resolution"]
    return part["resolution"] or max(LEAST_RESOLUTION, round(part["share"] * own))


def timed_methods(wildcards):
    """How a model of the run is timed: by every method, or by those of a design and their rivals."""
    part = config["times"]
    every = part["all_methods"] is None or wildcards.model in part["all_methods"]
    how = {} if every else {"design": True, "fine_runs": part["slow_runs"]}
    return [*times_arguments(part), *options(how)]


def times_arguments(part):
    """How methods are timed, from a part of the configuration."""
    keys = ("modes", "runs", "slow_runs", "tune", "arpack_regular", "rough", "rivals")
    return options({key: part.get(key) for key in keys})


# Methods in alternating runs, on a solid that may be coarser than the model itself.
rule time_methods:
    input:
        model=model_files,
        forests=FORESTS,
    output:
        f"{RESULTS}/models/{{model}}/methods.json",
    log:
        f"{LOGS}/models/{{model}}/methods.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/methods.tsv"
    threads: SOLVER_CORES
    resources:
        **limits("time_methods", ranks=RANKS),
    params:
        source=source("studies.benchmark.command"),
        model=lambda wildcards: model_arguments(wildcards, timed_resolution(wildcards)),
        how=timed_methods,
        forest=forest_argument,
    shell:
        solver_command("benchmark {params.model:q} {params.how:q} {params.forest:q}")
