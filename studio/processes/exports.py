"""A design in other forms, for other tools."""

from pathlib import Path

from carillon.errors import UserError
from sound.clips.wav import write_wav
from sound.export.engine_folder import write_engine_folder, zipped
from sound.export.formats import export_design
from sound.export.sound_set_options import SoundSetOptions
from sound.project.design import Design
from sound.project.design_file import read_design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit
from sound.rendering.rendered_sound import render_sound
from sound.rendering.solid import SoundingSolid


class Exports:
    """What the process for exports does."""

    def make(self, design: str, kind: str, target: str | None, out: str, name: str) -> None:
        """Write a design in the form `kind` to the file `out`; models in it have the name."""
        finished = read_design(design)
        if kind == "wav":
            _write_strike(finished, target, out)
        elif kind == "html":
            from studio.standalone import write_page

            write_page(out, finished)
        elif kind == "zip":
            _write_folder(finished, Path(out), name)
        else:
            export_design(out, finished, kind, name=name)


def _write_folder(design: Design, out: Path, name: str) -> None:
    """The folder for game engines, as `carillon export` makes it, as a ZIP file."""
    folder = out.parent / name
    write_engine_folder(folder, design, SoundSetOptions(), name=name)
    zipped(folder, out)


def _write_strike(design: Design, target: str | None, out: str) -> None:
    """The sound of a strike of 1 N s at a target, as `sound render` makes it."""
    strikes = {strike.name: strike for strike in design.strikes}
    if target not in strikes:
        raise UserError(
            f"the design has no target {target!r}, expected one of {', '.join(strikes)}"
        )
    strike = strikes[target]
    solid = SoundingSolid.of_design(design)
    hit = Hit(0.0, strike.position, strike.inward)
    listening = Listening.of_design(design, solid)
    sound = render_sound(solid, [hit], listening=listening)
    write_wav(out, sound.samples, sound.rate)
