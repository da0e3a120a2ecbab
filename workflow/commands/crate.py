"""Put a run into one ZIP file for an archive: its rules, configuration, inputs and results.

The file is an RO-Crate by the profile Workflow Run Crate: `ro-crate-metadata.json` in it says of
every file its length and SHA-256, and of every result the command, commit and versions of software
that made it, as the result tells it.
"""

import argparse
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from carillon.command_line.counts import counted
from carillon.command_line.outputs import require_outputs
from carillon.command_line.progress import track
from carillon.errors import UserError
from workflow import settings
from workflow.crate import contents, graph
from workflow.crate.archive import Copied, write_archive
from workflow.crate.citation import citation
from workflow.crate.origins import origin_of

EXAMPLES = """examples:
  crate results
  crate results --creator "Ada Lovelace" --licence CC-BY-4.0 --leave-out dataset --out bells.zip
"""
SPDX = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+-]*")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument(
        "results", nargs="?", type=Path, default=Path("results"), help="(default results)"
    )
    parser.add_argument(
        "--out", metavar="FILE", help="ZIP file to write (default RESULTS.crate.zip)"
    )
    parser.add_argument(
        "--creator", metavar="NAME", help="whose run it is (default: the authors of Carillon)"
    )
    parser.add_argument(
        "--licence",
        metavar="SPDX",
        help="licence of the crate, as SPDX calls it (default: that of Carillon)",
    )
    parser.add_argument(
        "--leave-out",
        nargs="+",
        default=[],
        metavar="NAME",
        help="files and folders of the results that stay out of it, such as dataset",
    )
    parser.add_argument("--json", action="store_true", help="tell what was written as JSON")


def run(arguments: argparse.Namespace) -> None:
    """Write the crate.

    Raises UserError for a folder that is not that of a run, or if it cannot be written.
    """
    results = Path(arguments.results)
    if arguments.out is not None and Path(arguments.out).suffix != ".zip":
        raise UserError(f"{arguments.out}: a crate is a ZIP file, whose name ends with .zip")
    graph.require_rocrate()
    found = contents.results_of(results, arguments.leave_out)
    arguments.out = arguments.out or f"{results.resolve().name}{contents.ENDING}"
    found = [file for file in found if not _is_same(file.path, Path(arguments.out))]
    config = settings.complete([results / contents.CONFIGURATION])
    about = _description(config, arguments.creator, arguments.licence)
    origins = {
        file: origin
        for file in track(found, "records", unit="files")
        if file.is_result and (origin := origin_of(file.path))
    }
    made_by = {file.name: origin for file, origin in origins.items()}
    named = {each: str(file.path) for file, origin in origins.items() for each in origin.inputs}
    files = [*contents.rules(), *contents.inputs(config, named), *found]
    require_outputs(arguments, [file.path for file in files])
    out = Path(arguments.out)
    copied = write_archive(out, files, lambda copies: graph.texts_of(copies, made_by, about))
    _tell(out, copied, len(made_by), arguments.json)


def _description(
    config: Mapping[str, Any], creator: str | None, licence: str | None
) -> graph.Description:
    software = citation()
    if creator is not None and not (creator.strip() and creator.isprintable()):
        raise UserError(f"--creator: found {creator!r}, expected a name")
    if licence is not None and not SPDX.fullmatch(licence):
        raise UserError(
            f"--licence: found {licence!r}, expected an identifier of SPDX, such as CC-BY-4.0"
        )
    return graph.Description(
        title=config["title"],
        configuration=settings.config_hash(config),
        software=software,
        creator=creator,
        licence=licence or software["license"],
    )


def _is_same(one: Path, other: Path) -> bool:
    return other.exists() and one.samefile(other)


def _tell(out: Path, files: Sequence[Copied], commands: int, as_json: bool) -> None:
    """Say what was written; inputs by name, since results of others may name any file."""
    size = sum(each.size for each in files)
    inputs = [each.file.original for each in files if each.file.role is contents.Role.INPUT]
    if as_json:
        told = {"out": str(out), "files": len(files), "bytes": size, "with_command": commands}
        print(json.dumps(told | {"inputs": inputs}, indent=2))
        return
    print(
        f"{out}: {counted(len(files), 'file')}, {size / 1e6:,.1f} MB, "
        f"{counted(commands, 'result')} with the command that made it"
    )
    if inputs:
        print(f"inputs: {', '.join(inputs)}")
