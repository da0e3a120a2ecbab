"""Web Audio: a module for browsers that plays the modes of a design, struck at its points."""

import hashlib
import json
from pathlib import Path

from carillon import __version__
from carillon.files.atomic import atomic_path
from sound.export.modal_model import ModalModel

_MODULE = Path(__file__).with_name("web_audio.js")


def write_web_audio(path: str | Path, model: ModalModel) -> None:
    """Write the modes as an ES module, which is its own AudioWorklet module.

    Raises UserError if the file cannot be written.
    """
    text = web_audio_module(model)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def web_audio_module(model: ModalModel) -> str:
    """The module's text."""
    content = json.dumps(
        {
            "name": model.name,
            "gain": model.gain,
            "frequencies": model.frequencies.tolist(),
            "dampings": model.dampings.tolist(),
            "points": [
                {
                    "name": point.name,
                    "position": point.position.tolist(),
                    "amplitudes": amplitudes.tolist(),
                }
                for point, amplitudes in zip(model.points, model.amplitudes, strict=True)
            ],
        }
    )
    # Processors of several solids are in one context by their names.
    processor = f"carillon-{hashlib.sha256(content.encode()).hexdigest()[:16]}"
    text = _MODULE.read_text(encoding="utf-8")
    for key, value in (("version", __version__), ("processor", processor), ("model", content)):
        # The model is last: its names may hold anything.
        text = text.replace(f"${key}", value)
    return text
