"""Draw samples and fit them, over as many workers as asked for, with the same result for any."""

import json
import logging
import shutil
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from carillon.command_line.progress import track
from carillon.errors import UserError
from carillon.files.paths import require_writable
from dataset_gen.journal import Journal, discard_journal, journal_of
from dataset_gen.settings import ShardOptions, settings_of
from dataset_gen.shards import Shard, origin_of, read_settings, shard_of, write_rows
from dataset_gen.tasks import ROW, ShardPlan, in_this_process, in_workers, rows_of

logger = logging.getLogger(__name__)

Engine = Callable[[ShardPlan, range], Generator[bytes, None, None]]
"""Yields the results of tasks in order; see `dataset_gen.tasks` and `dataset_gen.ranks`."""
_ENVIRONMENT = ("commit", "versions", "processor")
"""Attributes of an interrupted shard that may differ when it is gone on with."""


def engine_of(workers: int) -> Engine:
    """The engine for a number of processes on this machine.

    Raises UserError for less than one.
    """
    if workers < 1:
        raise UserError(f"{workers} workers requested, expected at least 1")
    if workers == 1:
        return in_this_process
    return lambda plan, tasks: in_workers(plan, tasks, workers)


def generate(options: ShardOptions, workers: int = 1, progress: bool = True) -> Shard:
    """Fit one shard in memory.

    A script that asks for several workers needs the usual `if __name__ == "__main__":`, since they
    import it. Raises UserError for an unknown objective or distribution, an impossible split, seed,
    range of moduli, Poisson's ratio or number of workers.
    """
    settings = settings_of(options)
    plan = ShardPlan(settings)
    label = f"fitting {settings.objective}"
    results = engine_of(workers)(plan, range(plan.tasks))
    tracked = _tracked(plan, results, label, visible=progress)
    rows = np.concatenate([rows_of(work) for work in tracked])
    return shard_of(settings, rows, origin_of(settings, options))


def generate_file(
    path: str | Path, plan: ShardPlan, origin: dict[str, Any], engine: Engine = in_this_process
) -> int | None:
    """Fit one shard and write it to `path` in constant memory; go on where an earlier run ended.

    Finished tasks go to the journal beside `path` and to the shard, which gets its name when it is
    complete; an interrupted one is written again from the journal. A shard that was interrupted has
    the same bytes as one that was not, unless it was finished with other software or on another
    machine: those are then listed in its provenance, `resumed_on`. Returns how many
    samples were fitted; None if `path` is this very shard already. Raises UserError if `path` is
    anything else, another process is writing it, the journal beside it belongs to other settings,
    or the disk is full or too small; what was done by then is kept.
    """
    path = require_writable(path)
    if _is_there(path, plan):
        discard_journal(path)
        return None
    _require_room(path, plan)
    journal = Journal(path, plan, {name: origin.get(name) for name in _ENVIRONMENT})
    finished = False
    try:
        # Another process may have finished it before this one got the journal.
        if path.exists():
            finished = _is_there(path, plan)
            return None
        before = journal.rows
        origin = origin | _environment(journal)
        write_rows(path, plan.settings, map(rows_of, _results(journal, engine)), origin)
        finished = True
    finally:
        journal.close(remove=finished or not journal.tasks)
    return plan.settings.count - before


def _require_room(path: Path, plan: ShardPlan) -> None:
    free = shutil.disk_usage(path.parent).free
    begun = journal_of(path)
    if begun.exists():
        free += begun.stat().st_size
    needed = 2 * plan.settings.count * ROW.itemsize
    if needed > free:
        raise UserError(
            f"{path}: {plan.settings.count:,} samples take {needed / 1e6:,.1f} MB while they are "
            f"generated, {free / 1e6:,.1f} MB are free; make room, or divide them over more shards"
        )


def _is_there(path: Path, plan: ShardPlan) -> bool:
    """Whether the finished shard of `plan` is at `path`; anything else but nothing is refused."""
    if not path.exists():
        return False
    try:
        existing = read_settings(path)
    except UserError as error:
        raise UserError(
            f"{path}: exists and is not the shard asked for ({error}); remove it or choose another "
            "name"
        ) from None
    different = existing.difference(plan.settings)
    if different is not None:
        raise UserError(
            f"{path}: exists with {different}; remove it or choose another name for the new shard"
        )
    return True


def _environment(journal: Journal) -> dict[str, Any]:
    first, *later = journal.environments
    return first | ({"resumed_on": json.dumps(later)} if later else {})


def _results(journal: Journal, engine: Engine) -> Iterator[bytes]:
    """Rows of all tasks in order: those in the journal, then new ones, once they are in it too."""
    plan = journal.plan
    if journal.tasks:
        logger.info(
            f"{journal.path}: going on after {journal.rows:,} of {plan.settings.count:,} samples"
        )
    before = journal.rows
    left = range(journal.tasks, plan.tasks)
    yield from journal.work()
    with closing(engine(plan, left)) as results:
        for work in _tracked(plan, results, f"fitting {plan.settings.objective}", before):
            journal.append(work)
            yield work


def _tracked(
    plan: ShardPlan, results: Iterator[bytes], label: str, done: int = 0, visible: bool = True
) -> Iterator[bytes]:
    return track(
        results,
        label,
        total=plan.settings.count,
        unit="samples",
        visible=visible,
        weight=lambda work: len(rows_of(work)),
        done=done,
    )
