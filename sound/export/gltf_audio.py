"""glTF: sounds, by the draft extension KHR_audio_emitter.

The draft is that of the repository omigroup/gltf-extensions, folder
extensions/2.0/KHR_audio_emitter, commit a59788c (2026); Khronos discusses it as pull request 2137
of KhronosGroup/glTF.  It admits MP3 (audio/mpeg) alone, and so do its players.
"""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from sound.export.gltf_asset import Buffer
from sound.rendering.listening import resampled

EXTENSION = "KHR_audio_emitter"
DRAFT = (
    "draft, repository omigroup/gltf-extensions, extensions/2.0/KHR_audio_emitter, commit a59788c"
)
RATES = (32_000, 44_100, 48_000)
"""Sampling rates [Hz] of MP3 at which it has enough bits."""
_QUALITY = 0.0
"""Compression of libsndfile's encoder, from 0, the least, to 1."""


def mp3_of(sound: Array, rate: int) -> bytes | None:
    """A sound (s,) or (s, c) within full scale as MP3, at the least rate that holds it.

    None, with a line that says so, where the library of sound files has no MP3.
    """
    import soundfile

    if "MP3" not in soundfile.available_formats():
        version = soundfile.__libsndfile_version__
        say(f"glTF without sound: libsndfile {version} writes no MP3, expected 1.1 or newer")
        return None
    own = next((each for each in RATES if each >= rate), RATES[-1])
    content = io.BytesIO()
    # Those who resample need finite ranges; the encoder has none beyond full scale.
    samples = np.clip(np.apply_along_axis(resampled, 0, sound, rate, own), -1.0, 1.0)
    soundfile.write(
        content,
        samples,
        own,
        format="MP3",
        subtype="MPEG_LAYER_III",
        compression_level=_QUALITY,
        bitrate_mode="VARIABLE",
    )
    return content.getvalue()


def audio_of(
    sounds: Sequence[tuple[str, Array]], rate: int, buffer: Buffer, positional: bool, autoplay: bool
) -> dict[str, Any] | None:
    """The document's extension: a source and an emitter for each named sound; None without MP3.

    Sounds are scaled to full range, and the sources' gains undo that.
    """
    audio, sources, emitters = [], [], []
    for number, (name, sound) in enumerate(sounds):
        peak = float(np.abs(sound).max(initial=0.0)) or 1.0
        content = mp3_of(sound / peak, rate)
        if content is None:
            return None
        audio.append({"bufferView": buffer.add_bytes(content), "mimeType": "audio/mpeg"})
        source: dict[str, Any] = {"name": name, "audio": number, "gain": peak}
        sources.append(source | ({"autoplay": True} if autoplay else {}))
        kind = "positional" if positional else "global"
        emitters.append({"name": name, "type": kind, "sources": [number]})
    return {"audio": audio, "sources": sources, "emitters": emitters}
