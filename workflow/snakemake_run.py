"""A target of the rules, made by Snakemake in a process of its own.

Snakemake alters the process that it runs in, and what its jobs print would be among what we say.
Its process tells what happens in lines of JSON: how many steps there are, how many are done, and
what went wrong.
"""

import json
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from carillon.command_line.exit_status import REPORT
from carillon.command_line.progress import say, track
from carillon.errors import UserError, one_line
from carillon.files.yaml_input import read_own_yaml
from workflow.settings import FOLDER

SNAKEFILE = FOLDER / "Snakefile"
PROFILE = FOLDER / "profiles" / "default" / "config.yaml"
"""Profile of a run on one machine."""
FAILED = 1
"""Exit status of the process if the target was not made."""


def run_target(
    target: str, configfile: Path, cores: int, log: Path, snakefile: Path = SNAKEFILE
) -> None:
    """Make a target of the rules, with all files in the folder of the configuration; show progress.

    Raises UserError with what a program said, or Snakemake, if the target was not made.

    Parameters
    ----------
    target
        Name of a rule.
    configfile
        The configuration of the run.
    cores
        Cores that its jobs may use at once.
    log
        File that gets what Snakemake and its jobs print.
    snakefile
        The rules.
    """
    folder = configfile.parent
    reading, writing = os.pipe()
    command = [sys.executable, "-m", __name__, target, configfile, cores, snakefile, writing]
    environment = {**os.environ, "PYTHONPATH": str(FOLDER.parent)}
    say(f"running on {cores} cores, see {log}")
    with (
        open(log, "w") as stream,
        open(reading) as messages,
        # In the folder of the results, as its jobs are.
        subprocess.Popen(
            list(map(str, command)),
            env=environment,
            cwd=folder,
            stdout=stream,
            stderr=stream,
            pass_fds=[writing],
        ) as process,
    ):
        os.close(writing)
        try:
            reason = followed(map(json.loads, messages), target)
            process.wait()
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        raise UserError(f"the run failed, {reason}; all that it said is in {log}")


def followed(messages: Iterator[dict[str, Any]], target: str) -> str:
    """Show how many steps are done until there are no more messages; returns what went wrong."""
    reasons = ["Snakemake ended without a word"]

    def steps() -> Iterator[int]:
        shown = 0
        for message in messages:
            yield from range(shown + 1, message.get("done", 0) + 1)
            shown = max(shown, message.get("done", 0))
            reasons.extend(filter(None, [message.get("error")]))

    say("planning the steps", sys.stderr.isatty())
    first = next(messages, {})
    if "total" in first:
        for _ in track(steps(), target, first["total"], "steps"):
            pass
    return first.get("error") or reasons[-1]


class Events(logging.Handler):
    """Tells how far Snakemake is; knows the rules whose jobs failed."""

    def __init__(self, channel: int) -> None:
        super().__init__()
        self.channel = channel
        self.failed: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Pass on the events of Snakemake's logger plugins that tell about steps."""
        match getattr(record, "event", None):
            case "run_info":
                self.tell(total=vars(record)["stats"]["total"])
            case "progress":
                self.tell(done=vars(record)["done"])
            case "job_error":
                self.failed.append(vars(record)["rule_name"])

    def tell(self, **message: Any) -> None:
        """Send a message, if somebody is there to read it."""
        with suppress(OSError):
            os.write(self.channel, f"{json.dumps(message)}\n".encode())


def main(words: list[str]) -> int:
    """Make a target and tell about it; returns the exit status."""
    from snakemake import logging as snakemake_logging
    from snakemake.api import SnakemakeApi
    from snakemake.settings import types

    target, configfile, cores, snakefile, channel = words
    profile = read_own_yaml(PROFILE)
    output = types.OutputSettings(printshellcmds=True, show_failed_logs=True)
    events = Events(int(channel))
    os.set_inheritable(events.channel, False)
    with tempfile.NamedTemporaryFile("r") as report, SnakemakeApi(output) as api:
        os.environ[REPORT] = report.name
        snakemake_logging.logger.addHandler(events)
        try:
            rules = api.workflow(
                types.ResourceSettings(
                    cores=int(cores), default_resources=profile["default-resources"]
                ),
                types.ConfigSettings(configfiles=[Path(configfile)]),
                snakefile=Path(snakefile),
                workdir=Path(configfile).parent,
            )
            triggers = types.RerunTrigger.parse_choices_set(profile["rerun-triggers"])
            requested = types.DAGSettings(
                targets={target}, force_incomplete=True, rerun_triggers=triggers
            )
            rules.dag(requested).execute_workflow()
        except Exception as error:
            events.tell(error=reason(list(report), events.failed, error))
            api.print_exception(error)
            return FAILED
    return 0


def reason(sentences: Iterable[str], failed: list[str], error: Exception) -> str:
    """Why a target was not made: what a program said, or that a job was ended, or Snakemake.

    Examples
    --------
    >>> reason(['"solver modes: no such file"'], ["find_modes"], RuntimeError("a job failed"))
    'solver modes: no such file'
    >>> reason([], ["find_modes"], RuntimeError("a job failed"))
    'rule find_modes ended without a word, as jobs do that are killed'
    >>> reason([], [], RuntimeError("Directory cannot be locked."))
    'Snakemake says: Directory cannot be locked'
    """
    said = [json.loads(sentence) for sentence in sentences]
    if said:
        return one_line(said[-1]).rstrip(".")
    if failed:
        return f"rule {failed[-1]} ended without a word, as jobs do that are killed"
    return f"Snakemake says: {one_line(str(error)).rstrip('.')}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
