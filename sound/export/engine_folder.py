"""A folder of all that a game engine takes of a design: sounds with their levels, model, modes."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from carillon.command_line.progress import say
from carillon.errors import UserError
from sound.export.faust import faust_program
from sound.export.formats import ExportSettings
from sound.export.gltf import write_gltf
from sound.export.level_table import FORMAT, LevelRow, levels_csv, levels_json, with_gains
from sound.export.modal_model import ModalModel
from sound.export.modal_table import impact_objects, write_modal_csv, write_modal_json
from sound.export.names import file_name, file_names
from sound.export.placing import FileTable, filling
from sound.export.sound_set import rendered_set, require_count
from sound.export.sound_set_options import SoundSetOptions
from sound.export.web_audio import web_audio_module
from sound.export.wwise import wwise_import
from sound.project.design import Design

SOUNDS = "sounds"
"""Name of the folder of sounds, and of the tables beside it."""
TABLE = f"{SOUNDS}.json"
"""Name of the table that lists the files of an export."""
WWISE = f"{SOUNDS}-wwise.txt"
"""Name of the list that Wwise imports."""
TABLES = (WWISE, f"{SOUNDS}.csv", TABLE)
"""Names of the tables of sounds."""
SOUND_SET = FileTable(
    TABLE,
    FORMAT,
    re.compile(
        rf"{SOUNDS}/[a-z0-9_]+\.wav|[a-z0-9_]+\.(glb|dsp|js|impobj)|[a-z0-9_]+-modes\.(json|csv)"
        rf"|{SOUNDS}-wwise\.txt|{SOUNDS}\.(csv|json)"
    ),
    SOUNDS,
)
"""How an export knows its files."""


@dataclass(frozen=True)
class WrittenFolder:
    """What was written: names of files in the folder, levels of the sounds, and what is missing.

    `removed` are those of a former export that this one has not written again.
    """

    files: list[str]
    levels: list[LevelRow]
    missing: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)


def write_engine_folder(
    path: str | Path,
    design: Design,
    options: SoundSetOptions,
    settings: ExportSettings | None = None,
    name: str | None = None,
) -> WrittenFolder:
    """Fill a folder, made if it is missing: sounds, their levels, glTF, Faust, Web Audio, tables.

    Once all are written, files of a former export, which its `sounds.json` lists, are removed or
    replaced; others stay, as game engines keep their own beside them.  A model that fails does not
    take the sounds along: a line of progress says why.  Raises UserError if the sounds are too many
    or the folder cannot be written, and leaves the folder as it is then.
    """
    settings = settings or ExportSettings()
    model = ModalModel.of_design(design, settings.points, name)
    require_count(len(model.points), options)
    with filling(path, SOUND_SET, TABLES) as folder:
        written = _write_all(folder.staged, design, model, options, settings)
        removed = folder.place(written.files)
    return replace(written, removed=removed)


def _write_all(
    folder: Path,
    design: Design,
    model: ModalModel,
    options: SoundSetOptions,
    settings: ExportSettings,
) -> WrittenFolder:
    """Tables of sounds are the last files: who finds them, finds what they name."""
    label = file_name(model.name, "solid")
    (folder / SOUNDS).mkdir()
    made = []
    for sound in rendered_set(design, model.name, model.points, options):
        (folder / SOUNDS / sound.level.file).write_bytes(sound.content)
        made.append((sound.gain, sound.level))
    files, missing = [], []
    for file, write in _models(design, model, settings, label).items():
        try:
            write(folder / file)
            files.append(file)
        except UserError as error:
            if isinstance(error.__cause__, OSError):  # the disk, not the model
                raise
            say(f"{file} is left out: {error}")
            missing.append(file)
    levels = with_gains(made)
    (folder / WWISE).write_text(wwise_import(levels, SOUNDS))
    (folder / f"{SOUNDS}.csv").write_text(levels_csv(levels))
    all_files = [*(f"{SOUNDS}/{level.file}" for level in levels), *files, *TABLES]
    text = levels_json(model.name, levels, options.rate, options.seed, all_files)
    (folder / TABLE).write_text(text)
    return WrittenFolder(all_files, levels, missing)


def _models(
    design: Design, model: ModalModel, settings: ExportSettings, label: str
) -> dict[str, Callable[[Path], object]]:
    """By file, what writes it."""
    writers: dict[str, Callable[[Path], object]] = {
        f"{label}.glb": lambda path: write_gltf(path, design, True, settings.up, model.name),
        f"{label}.dsp": lambda path: path.write_text(faust_program(model)),
        f"{label}.js": lambda path: path.write_text(web_audio_module(model), encoding="utf-8"),
        f"{label}-modes.json": lambda path: write_modal_json(path, model),
        f"{label}-modes.csv": lambda path: write_modal_csv(path, model),
    }
    names = file_names([point.name for point in model.points])
    for each, text in zip(names, impact_objects(model), strict=True):
        writers[f"{label}_{each}.impobj"] = partial(_write_text, text)
    return writers


def _write_text(text: str, path: Path) -> None:
    path.write_text(text)


def zipped(folder: Path, archive: Path) -> None:
    """Pack a folder as a ZIP file of the same name in it."""
    made = shutil.make_archive(str(archive.with_suffix("")), "zip", folder.parent, folder.name)
    os.replace(made, archive)
