# Names, folders and helper functions that the other rules share.
import os
import shlex
import shutil
import sys
from pathlib import Path

from workflow import locks, submission, training, variants
from workflow.arguments import options, path_word, quoted
from workflow.sources import fingerprint as source

RESULTS = str(Path(config["results_dir"]))
LOGS = f"{RESULTS}/logs"
BENCHMARKS = f"{RESULTS}/benchmarks"
MODELS = list(config["models"])

# Timed rules take all cores, so that no other job disturbs their wall times. On a cluster nothing says
# how many there are but the configuration.
ALL_CORES = submission.cores_of_run(workflow.resource_settings.cores, workflow.remote_exec)
SOLVER_CORES = config["solver"]["cores"] or ALL_CORES
RANKS = config["solver"]["ranks"]
# Runs whose result is a spectrum go side by side: threads within one leave more of a core idle.
RUN_CORES = config["solver"]["cores"] or min(ALL_CORES, max(RANKS, ALL_CORES // 4))
# What starts ranks, in a job of SLURM its own, which an image for containers does not have.
IN_SLURM = "SLURM_JOB_ID" in os.environ and shutil.which("srun")
ANY_LAUNCHER = "srun --mpi=pmix" if IN_SLURM else "mpiexec"
LAUNCHER = config["solver"]["launcher"] or ANY_LAUNCHER
# The executor hides from what starts ranks how many cores they have and on which nodes they are: srun
# would bind each to one core, and mpiexec fail.
BY_SRUN = Path(shlex.split(LAUNCHER)[0]).name == "srun"
TELLS_CORES = workflow.remote_exec and BY_SRUN
if workflow.remote_exec:
    submission.hand_on_places(not BY_SRUN)


def resources_of(ranks, cores):
    """Ranks, their share of the cores, and if they are several, as `mpi`, what starts them.

    The words of `mpi` are quoted here, as it is the one thing that goes to a shell as it is. Of an
    array with this resource, empty or not, SLURM's executor runs the first job only.
    """
    launcher = {"mpi": quoted(LAUNCHER)} if ranks > 1 else {}
    return {"tasks": ranks, "cpus_per_task": max(1, cores // ranks), **launcher}


def python_on(ranks):
    """Python in a shell command; on several ranks one's failure ends them all with -m mpi4py."""
    cores = " --cpus-per-task={resources.cpus_per_task:q}" if TELLS_CORES else ""
    started = "{resources.mpi} -n {resources.tasks:q}" + cores
    return f"{started} python -m mpi4py" if ranks > 1 else "python"


def solver_command(how, program="solver"):
    """Shell command of the solver on ranks that share the threads of the rule.

    In a job of a cluster Snakemake cuts `threads` to the cores of the first node, although ranks
    may be on others: each has the cores that were asked for it.
    """
    threads = "$(( {threads} > {resources.tasks:q} ? {threads} / {resources.tasks:q} : 1 ))"
    threads = "{resources.cpus_per_task:q}" if workflow.remote_exec else threads
    python = f"OMP_NUM_THREADS={threads} {python_on(RANKS)}"
    return f"{python} -m {program} {how} --out {{output:q}} > {{log:q}} 2>&1"


def study_command(how):
    """The same of a study."""
    return solver_command(f"study {how}", "carillon")


def trees_command(plan, command, how):
    """Shell command that grows trees or fits leaves, on ranks that share the threads of the rule."""
    workers = "$(( {threads} > {resources.tasks:q} ? {threads} / {resources.tasks:q} : 1 ))"
    workers = "{resources.cpus_per_task:q}" if workflow.remote_exec else workers
    python = python_on(plan.forests["ranks"])
    return f"{python} -m forests {command} {how} --workers {workers} --out {{output:q}} > {{log:q}} 2>&1"


def block_arguments(part):
    """Blocks that forests are rated on, from a part of the configuration."""
    return options({key: part[key] for key in ("blocks", "materials")})


def checked(shards):
    """Summaries of shards, whose making reads and checks every byte of them, once in a run."""
    return [f"{shard.removesuffix('.h5')}.json" for shard in shards]


def shard_memory(plan):
    """Megabytes for drawing samples, in every worker and in what writes them."""
    return 500 + 500 * plan.dataset["workers"]


def tree_memory(plan):
    """Megabytes of a rank that grows a tree: 44 bytes for each of its rows, which are four fifths of
    all at most, a third more on several ranks, and 1 kB a leaf."""
    ranks = plan.forests["ranks"]
    rows = 0.8 * plan.forests["structure_rows"] * (1.0 if ranks == 1 else 1.33 / ranks)
    return 1000 + int(44e-6 * rows + 1e-3 * plan.forests["max_leaves"])


def leaves_memory(plan):
    """Megabytes of a rank that fits leaves: 0.75 kB for each of all trees, 3.8 kB in the one at work."""
    leaves = plan.forests["max_leaves"] * (2 * plan.forests["trees"] * 0.75 + 3.8) / 1000
    return 1500 + int(leaves)


def growing(first):
    """Resource that doubles with every try: a job that ran out of it gets more."""
    return lambda wildcards, attempt: first * 2 ** (attempt - 1)


def limits(rule, memory=None, ranks=None, cores=SOLVER_CORES):
    """Memory and time of a rule from the configuration, and what its ranks need if it has any.

    `memory` [MB] of one rank, or of the job if it has none, is taken if the configuration names
    none. Ranks may be on any number of nodes: SLURM is asked for memory by core, since it takes
    `mem_mb` for that of each node; to Snakemake `mem_mb` is what a job takes in all.
    """
    asked = config["resources"][rule]
    of_rank = asked["memory_mb"] or memory
    found = {"mem_mb": growing((ranks or 1) * of_rank), "runtime": growing(asked["minutes"])}
    if ranks:
        found |= resources_of(ranks, cores)
    if (ranks or 1) > 1:
        found["mem_mb_per_cpu"] = growing(-(-of_rank // found["cpus_per_task"]))
    return found


def tree_limits(rule, plan):
    """Limits of a rule that grows a tree."""
    return limits(rule, tree_memory(plan), plan.forests["ranks"], plan.cores(1))


def leaves_limits(rule, plan):
    """Limits of a rule that fits leaves."""
    return limits(rule, leaves_memory(plan), plan.forests["ranks"], plan.cores(SOLVER_CORES))


wildcard_constraints:
    model="|".join(MODELS),
    variant="|".join(variants.VARIANTS),
    distribution="uniform|log-uniform",
    shard=r"\d+",


def prepend(variable, folder):
    """Put a folder first in a search path of the jobs' environment."""
    rest = os.environ.get(variable)
    os.environ[variable] = f"{folder}{os.pathsep}{rest}" if rest else str(folder)


# Jobs of a cluster parse this file too.
ALONE = workflow.is_main_process and locks.take()

# Jobs run the interpreter that Snakemake runs in, and the packages of this checkout.
prepend("PATH", Path(sys.executable).parent)
prepend("PYTHONPATH", settings.FOLDER.parent)
# Ranks get their share of the cores as threads, which a rank bound to one core could not use; and
# Open MPI refuses to start as root, the usual user of a container, unless told twice.
for name, value in {
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "PRTE_MCA_hwloc_default_binding_policy": "none",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
}.items():
    os.environ.setdefault(name, value)
