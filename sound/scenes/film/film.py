"""Films of scenes: video files with picture and sound."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from carillon.command_line.progress import track
from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from carillon.processes.threads import blas_threads
from sound.outputs import require_output
from sound.scenes.film.frames import Stage
from sound.scenes.packages import scene_package
from sound.scenes.performance import Performance

if TYPE_CHECKING:
    from av.audio.stream import AudioStream
    from av.container import OutputContainer
    from av.video.stream import VideoStream

FRAMES_PER_SECOND = 30
SIZE = (960, 540)
"""Width and height of a film [pixels]."""
SOUND_RATE = 48_000
"""Sampling rate of formats that do not support the sound's own [Hz]."""
COLOURS = 1
"""Number of ITU-R BT.709 among colour spaces, primaries and transfer curves (ITU-T H.273)."""
LIMITED_RANGE = 1
"""FFmpeg's number for a range from 16 to 235."""


@dataclass(frozen=True)
class FilmFormat:
    """Format of a film: container and codecs, with FFmpeg's options for each."""

    container: str
    container_options: dict[str, str]
    picture: str
    picture_options: dict[str, str]
    sound: str
    sound_bits: int


FORMATS = {
    ".mp4": FilmFormat(
        "mp4",
        {"movflags": "faststart"},
        "libx264",
        {
            "preset": "medium",
            "crf": "19",
            # Without frames that refer to later ones, so the first frame is the first in the file.
            "bf": "0",
            # x264's code for AVX2 rounds differently, and for one film in thirty not reproducibly.
            "x264-params": "asm=SSE4.2",
        },
        "aac",
        192_000,
    ),
    ".webm": FilmFormat(
        "webm",
        {},
        "libvpx-vp9",
        {"crf": "28", "b": "0", "deadline": "realtime", "cpu-used": "6"},
        "libopus",
        160_000,
    ),
}
"""Formats by the ending of the file's name."""


def write_film(
    path: str | Path,
    performance: Performance,
    frames_per_second: int = FRAMES_PER_SECOND,
    size: tuple[int, int] = SIZE,
) -> None:
    """Write the video of a scene: H.264 and AAC in `.mp4`, VP9 and Opus in `.webm`.

    Frame n shows the time n / `frames_per_second`; the last one lasts at least until the sound
    ends.  Width and height [pixels] are even numbers.  The same performance gives the same bytes.
    Raises UserError if the name has another ending, the file cannot be written, the size is odd or
    a package is missing.
    """
    path = require_output(path, FORMATS)
    _require_frames(frames_per_second, size)
    av = scene_package("av")
    form = FORMATS[path.suffix.lower()]
    # The rounding of matrix products may depend on the number of threads.
    with atomic_path(path) as temporary, blas_threads(1):
        stage = Stage(performance.picture, size)
        with av.open(str(temporary), "w", form.container, form.container_options) as container:
            container.metadata["title"] = performance.title
            container.flags |= av.container.Flags.bitexact.value
            picture = _picture_stream(container, form, frames_per_second, size)
            sound = _sound_stream(container, form, performance.rate)
            _encode(container, picture, sound, stage, performance)


def _require_frames(frames_per_second: int, size: tuple[int, int]) -> None:
    if frames_per_second < 1:
        raise UserError(f"{frames_per_second} frames per second, expected 1 or more")
    if min(size) < 2 or size[0] % 2 or size[1] % 2:
        raise UserError(f"a size of {size[0]} x {size[1]} pixels, expected even numbers")


def _picture_stream(
    container: OutputContainer, form: FilmFormat, frames_per_second: int, size: tuple[int, int]
) -> VideoStream:
    # The bytes depend on the number of threads.
    options = {**form.picture_options, "threads": "1"}
    added = container.add_stream(form.picture, frames_per_second, options)
    stream = cast("VideoStream", added)
    stream.width, stream.height = size
    stream.pix_fmt = "yuv420p"
    stream.time_base = stream.codec_context.time_base = Fraction(1, frames_per_second)
    context = stream.codec_context
    context.colorspace = context.color_primaries = context.color_trc = COLOURS
    context.color_range = LIMITED_RANGE
    return stream


def _sound_stream(container: OutputContainer, form: FilmFormat, rate: int) -> AudioStream:
    codec = scene_package("av").codec.Codec(form.sound, "w")
    taken = not codec.audio_rates or rate in codec.audio_rates
    added = container.add_stream(form.sound, rate if taken else SOUND_RATE)
    stream = cast("AudioStream", added)
    stream.layout = "stereo"
    stream.bit_rate = form.sound_bits
    return stream


def _encode(
    container: OutputContainer,
    picture: VideoStream,
    sound: AudioStream,
    stage: Stage,
    performance: Performance,
) -> None:
    """Write the frames, each followed by the sound until the next one."""
    av = scene_package("av")
    per_second = int(picture.codec_context.framerate)
    samples, rate = performance.sound.astype(np.float32), performance.rate
    count = -(-len(samples) * per_second // rate)
    for number in track(range(count), "film", unit="frames"):
        frame = av.VideoFrame.from_ndarray(stage.frame(number / per_second), format="rgb24")
        frame.pts, frame.time_base = number, Fraction(1, per_second)
        container.mux(picture.encode(frame.reformat(format="yuv420p", dst_colorspace=COLOURS)))
        begin, end = (each * rate // per_second for each in (number, number + 1))
        part = av.AudioFrame.from_ndarray(
            np.ascontiguousarray(samples[begin:end]).reshape(1, -1), "flt", "stereo"
        )
        part.sample_rate, part.pts, part.time_base = rate, begin, Fraction(1, rate)
        container.mux(sound.encode(part))
    container.mux(picture.encode())
    container.mux(sound.encode())
