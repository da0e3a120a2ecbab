"""Fixtures that every test may use: MPI runs, command-line runs, the meshes beside the checkout."""

import asyncio
import hashlib
import inspect
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

import carillon
from carillon.processes import mpi_environment
from carillon.processes.threads import allowed_threads
from tests import tiers
from tests.chromium import chromium
from tests.hostile import fuzzing, summary
from tests.hostile.fixtures import suite, tried, zoo  # noqa: F401
from tests.once import once
from tests.patience import HANG_SECONDS
from tests.workflow_runs import planned
from tests.zygote import Job, Limits, Zygote

CHECKOUT = Path(__file__).resolve().parent
MESH_FILES = ("stanford-bunny.obj", "teapot.obj")

RANKS = {
    # Open MPI refuses to run as root, the usual user of a container, unless told twice.
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # More ranks than cores, told to Open MPI 4 and 5; other MPIs allow it anyway.
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    # Other tests run beside them: ranks let those work while they wait, on whichever core.
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
}

# Processes of tests, and those that they start, begin and end all the time.
mpi_environment.keep_apart(os.environ, os.getpid())

Run = Callable[..., "subprocess.CompletedProcess[str]"]


DUE: pytest.StashKey[frozenset[str]] = pytest.StashKey()
"""Files whose nightly tests are run in the tier `part`."""
CHANGED: pytest.StashKey[list[str]] = pytest.StashKey()
"""Files that differ from the main branch."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--tier",
        choices=tiers.TIERS,
        default=tiers.TIERS[0],
        help="what every change needs (default), that and the nightly tests that are due, or all",
    )


def pytest_configure(config: pytest.Config) -> None:
    due: frozenset[str] = frozenset()
    if hasattr(config, "workerinput"):
        due = frozenset(config.workerinput["due"])
        config.stash[CHANGED] = list(config.workerinput["changed"])
    else:
        config.stash[CHANGED] = tiers.changed_files()
        if config.getoption("--tier") == "part":
            due = tiers.due(tiers.measured()).files
    config.stash[DUE] = due
    all_tests = config.getoption("--tier") == "all"
    fuzzing.load("nightly" if all_tests else "part" if due & fuzzing.FILES else "change")


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    node.workerinput["due"] = sorted(node.config.stash[DUE])
    node.workerinput["changed"] = node.config.stash[CHANGED]


def pytest_report_header(config: pytest.Config) -> str | None:
    due = config.stash[DUE]
    return f"nightly tests of: {', '.join(sorted(due))}" if due else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what is not of the tier; files that take longest first, so that none is left."""

    def spared(item: pytest.Item) -> bool:
        mark = item.get_closest_marker("nightly")
        return mark is not None and tiers.is_spared(
            tiers.name_of(item.path),
            config.stash[DUE],
            mark.kwargs.get("unless", ()),
            config.stash[CHANGED],
        )

    if config.getoption("--tier") != "all":
        config.hook.pytest_deselected(items=[item for item in items if spared(item)])
        items[:] = [item for item in items if not spared(item)]

    def first(item: pytest.Item) -> int:
        marks = {mark.name for mark in item.iter_markers()}
        return 0 if "slurm" in marks else 1 if marks & {"slow", "nightly"} else 2

    rank: dict[Path, int] = {}
    for item in items:
        rank[item.path] = min(first(item), rank.get(item.path, 2))
    items.sort(key=lambda item: rank[item.path])


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    names = inspect.signature(pyfuncitem.obj).parameters
    asyncio.run(pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in names}))
    return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What was hostile, what was killed, and what became of it."""
    reports = [r for key in ("passed", "failed") for r in terminalreporter.stats.get(key, [])]
    told = summary.lines((dict(r.user_properties), r.passed) for r in reports if r.when == "call")
    if told:
        terminalreporter.section("hostile inputs and kills")
        terminalreporter.write("\n".join([*told, ""]))


def _run(
    command: list[str],
    threads: int,
    *,
    timeout: float = HANG_SECONDS,
    check: bool = False,
    env: Mapping[str, str] | None = None,
    cwd: Path | str | None = None,
) -> subprocess.CompletedProcess[str]:
    # What a command that was called in this process has set is not handed on: with a safe path,
    # `python -m mpi4py SCRIPT` looks for modules beside the script in place of PYTHONPATH.
    given = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    own = {"OMP_NUM_THREADS": str(threads), "PYTHONPATH": str(CHECKOUT)}
    try:
        done = subprocess.run(
            command,
            env={**given, **own, **RANKS, **(env or {})},
            timeout=timeout,
            cwd=cwd or CHECKOUT,
            capture_output=True,
            text=True,
        )
    except subprocess.TimeoutExpired as error:
        output = error.stderr or b""
        text = output.decode(errors="replace") if isinstance(output, bytes) else output
        pytest.fail(f"no end after {timeout:g} s: {' '.join(command)}\n{text}")
    return _checked(done) if check else done


def _checked(done: subprocess.CompletedProcess[str]) -> subprocess.CompletedProcess[str]:
    if done.returncode != 0:
        shown = " ".join(done.args)
        pytest.fail(f"exit status {done.returncode}: {shown}\n{done.stdout}\n{done.stderr}")
    return done


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests, and the programs that they start, keep what they found to themselves."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CARILLON_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session", autouse=True)
def names_of_examples(doctest_namespace: dict[str, Any]) -> None:
    doctest_namespace["ca"] = carillon


@pytest.fixture(scope="session")
def zygote() -> Iterator[Zygote]:
    """A process that has imported everything, and forks for each program that tests run."""
    found = Zygote(RANKS)
    yield found
    found.close()


@pytest.fixture(scope="session")
def run_cli(zygote: Zygote) -> Run:
    """Run `python -m MODULE ARGUMENTS...`, forked, and return the CompletedProcess.

    On one thread. Keywords: `check` (fail the test unless the exit status is 0), `cwd`.
    """
    limits = Limits(cpu_seconds=int(HANG_SECONDS), address_space=16 << 30, file_size=4 << 30)

    def run(
        module: str, *arguments: object, check: bool = False, cwd: Path | str = CHECKOUT
    ) -> subprocess.CompletedProcess[str]:
        words = [str(word) for word in arguments]
        outcome = zygote.run(Job(module, words, str(cwd), limits=limits))
        done = subprocess.CompletedProcess(
            [module, *words], outcome.status, outcome.stdout, outcome.stderr
        )
        return _checked(done) if check else done

    return run


@pytest.fixture(scope="session")
def together(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of all processes of this session of tests."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="session")
def dry_run(run_cli: Run) -> Run:
    """Function that plans a run of Snakemake in a folder, `dry_run(folder, *arguments)`, forked."""

    def run(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
        snakefile = ("-s", CHECKOUT / "Snakefile")
        return run_cli("snakemake", *snakefile, "--dry-run", *arguments, cwd=folder)

    return run


@pytest.fixture(scope="session")
def plan(dry_run: Run, together: Path) -> Callable[..., dict[str, int]]:
    """Function that counts by rule the jobs of a run in an empty folder, each once for all tests.

    Called as `plan(*targets_and_options)`.
    """

    def counted(*arguments: object) -> dict[str, int]:
        words = [str(word) for word in arguments]
        name = hashlib.sha256(json.dumps(words).encode()).hexdigest()[:16]
        with once(together / f"plan-{name}") as folder:
            jobs = folder / "jobs.json"
            if not jobs.exists():
                (folder / "empty").mkdir()
                found = planned(dry_run(folder / "empty", "--cores", 2, *words))
                jobs.write_text(json.dumps(found))
            return dict(json.loads(jobs.read_text()))

    return counted


@pytest.fixture(scope="session")
def start_cli() -> Run:
    """Start `python -m MODULE ARGUMENTS...` as people do and return the CompletedProcess.

    Keywords: `timeout` [s], `check` (fail the test unless the exit status is 0), `env` (variables
    added to the environment), `cwd`.
    """

    def run(module: str, *arguments: object, **how: Any) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", module, *map(str, arguments)]
        return _run(command, allowed_threads(), **how)

    return run


@pytest.fixture(scope="session")
def mpiexec() -> Run:
    """Run `python -m mpi4py -m MODULE ARGUMENTS...` on a number of ranks.

    Called as `mpiexec(ranks, module, *arguments)`; keywords as for `run_cli`.  A module that ends
    in `.py` is run as a script.  Each rank gets its share of the cores as threads, one at least.
    """
    launcher = shutil.which("mpiexec")
    if launcher is None:
        pytest.fail("no mpiexec on PATH; run the tests with `make test`, which installs MPI")

    def run(
        ranks: int, module: str | Path, *arguments: object, **how: Any
    ) -> subprocess.CompletedProcess[str]:
        target = [str(module)] if str(module).endswith(".py") else ["-m", str(module)]
        program = [sys.executable, "-m", "mpi4py", *target, *map(str, arguments)]
        command = [launcher, "-n", str(ranks), *program]
        return _run(command, max(1, allowed_threads() // ranks), **how)

    return run


@pytest.fixture(scope="session")
def meshes() -> Path:
    """Folder with the meshes of MESH_FILES; skips the test where it is absent."""
    named = os.environ.get("CARILLON_MESHES")
    folder = Path(named) if named else CHECKOUT.parent / "shared" / "models"
    missing = [name for name in MESH_FILES if not (folder / name).is_file()]
    if missing:
        pytest.skip(
            f"no {' and '.join(missing)} in {folder}; set CARILLON_MESHES to a folder that has them"
        )
    return folder


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser of playwright's; skips the test where there is none."""
    with chromium() as found:
        yield found


@pytest.fixture
def refuses(capsys):
    """Function that has a program's `main` refuse its words, and returns the sentence."""

    def refusal(main, *words) -> str:
        capsys.readouterr()
        assert main([str(word) for word in words]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    return refusal
