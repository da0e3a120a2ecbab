"""Sound files: clips are read, unless they were cut short, and sounds are written."""

import io
import os
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from carillon.files.paths import cause, require_file
from sound.bounds import (
    FLOAT_BITS,
    HIGHEST_RATE,
    LOWEST_RATE,
    MOST_CHANNELS,
    MOST_CLIP_SAMPLES,
    require_level,
)
from sound.clips.formats import A_CLIP
from sound.clips.free_vibration import CLIPPED_RUN, is_clipped
from sound.levels import dithered
from sound.outputs import require_output

ENDINGS = (".wav",)
"""Endings of the names of sound files that are written."""
PEAK = 0.89
"""Peak magnitude of a normalised sound: 1 dB below full scale."""
UNKNOWN = 0x7FFF_F000
"""Least length of a chunk that stands for an unknown one: programs that write to a pipe cannot fill
in the length later."""
MOST_CHUNKS = 1000
"""Greatest number of chunks that are read; a recording has a few."""
_HEAD = 12
"""Length of the file's head [bytes]."""


def read_wav(path: str | Path, allow_clipped: bool = False) -> tuple[Array, int]:
    """Samples (s,) of a sound file, full scale being 1, and their rate [Hz].

    Of several channels, the loudest of those clipped least is read: microphones at several places
    receive each mode at another phase, and some modes cancel in the mean.  Raises UserError if the
    file is missing, cut off or not a sound file, is empty, silent, clipped (unless that is allowed)
    or longer than `MOST_CLIP_SAMPLES`, or has samples that are not finite numbers; or if its rate,
    its number of channels or its level is beyond `sound.bounds`.
    """
    path = require_file(path, A_CLIP)
    try:
        channels, rate = _channels(path)
        return _heard(channels, allow_clipped), rate
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def write_wav(
    path: str | Path,
    samples: Array,
    rate: int,
    peak: bool = False,
    bits: int = FLOAT_BITS,
    seed: int = 0,
) -> None:
    """Write one channel (s,) or several (s, c) as WAV, atomically; full scale is 1.

    Samples are floats of 32 `bits`, or whole numbers of 16 or 24 with dither of a `seed`.  With
    `peak`, the largest magnitude becomes `PEAK`.  Raises UserError if the name does not end in
    .wav, samples are not finite or beyond what the format holds, or the file cannot be written.
    """
    require_output(path, ENDINGS)
    samples = np.asarray(samples, dtype=float)
    largest = float(np.abs(samples).max(initial=0.0))
    if not np.isfinite(largest):
        raise UserError(f"{path}: not written, the sound has samples that are not finite numbers")
    if peak and largest > 0.0:
        samples, largest = samples * (PEAK / largest), PEAK
    if largest > 1.0 and bits != FLOAT_BITS:
        raise UserError(
            f"{path}: not written, the sound reaches {largest:.4g} times full scale, more than "
            f"whole numbers of {bits} bits hold; write {FLOAT_BITS} bits, or a fainter sound"
        )
    if largest > np.finfo(np.float32).max:
        raise UserError(
            f"{path}: not written, the sound reaches {largest:.3g}, more than its samples hold"
        )
    # Through memory, since the library does not say why it could not write to a disk.
    content = as_wav(samples, rate, bits, seed)
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def as_wav(samples: Array, rate: int, bits: int = FLOAT_BITS, seed: int = 0) -> bytes:
    """One channel (s,), or several (s, c), as the content of a WAV file; see `write_wav`.

    The same samples make the same bytes: of floats, libsndfile would add the time of day (chunk
    PEAK).
    """
    content = io.BytesIO()
    if bits == FLOAT_BITS:
        from scipy.io import wavfile  # Slow to load.

        wavfile.write(content, rate, samples.astype(np.float32))
    else:
        import soundfile  # Slow to load.

        # libsndfile takes the upper bits of whole numbers of 32 bits.
        whole = dithered(samples, bits, seed) << (32 - bits)
        soundfile.write(content, whole, rate, format="WAV", subtype=f"PCM_{bits}")
    return content.getvalue()


def _channels(path: Path) -> tuple[Array, int]:
    """Samples (s, c) and their rate [Hz]; bounds are checked before samples are read.

    Raises UserError that does not name the file.
    """
    import soundfile  # Slow to load.

    try:
        missing = missing_bytes(path)
        with soundfile.SoundFile(path) as file:
            _require_bounds(file.samplerate, file.channels, file.frames)
            channels = file.read(dtype="float64", always_2d=True)
            missing = missing or file.frames - len(channels)
            rate = int(file.samplerate)
    except TypeError:  # the library asks for the header's values
        raise UserError(
            "has samples alone by its name, without a header that tells their rate and kind; "
            f"expected {A_CLIP}, convert it to one"
        ) from None
    except (soundfile.LibsndfileError, OSError) as error:
        said = cause(error) if isinstance(error, OSError) else str(error).rsplit(": ", 1)[-1]
        raise UserError(
            f"is not readable as a sound file ({str(said).strip().rstrip('.')}), expected {A_CLIP}"
        ) from None
    if missing:
        raise UserError("ends before the samples that it claims to hold; copy or record it again")
    return channels, rate


def _require_bounds(rate: int, channels: int, frames: int) -> None:
    if not LOWEST_RATE <= rate <= HIGHEST_RATE:
        raise UserError(
            f"has {rate:,} samples per second, expected {LOWEST_RATE:,} to {HIGHEST_RATE:,}"
        )
    if channels > MOST_CHANNELS:
        raise UserError(f"has {channels:,} channels, expected at most {MOST_CHANNELS}")
    if frames * channels > MOST_CLIP_SAMPLES:
        raise UserError(
            f"lasts {frames / rate:,.0f} s, which are {frames * channels:,} samples; expected a "
            f"single strike, {MOST_CLIP_SAMPLES:,} samples at most; cut it out"
        )


def _heard(channels: Array, allow_clipped: bool) -> Array:
    """The channel (s,) of channels (s, c) that is searched.

    Raises UserError that does not name the file.
    """
    if not len(channels):
        raise UserError("has no samples, expected the sound of a strike")
    bad = int((~np.isfinite(channels)).sum())
    if bad:
        raise UserError(
            "has samples that are not finite numbers (NaN or infinite), "
            f"{bad:,} of {channels.size:,}; repair or record it again"
        )
    require_level(float(np.abs(channels).max()))
    clipped = [int(is_clipped(channel).sum()) for channel in channels.T]
    best = int(np.lexsort((-np.linalg.norm(channels, axis=0), clipped))[0])
    if clipped[best] and not allow_clipped:
        raise UserError(
            f"is clipped ({clipped[best]} samples at full scale, some in runs of {CLIPPED_RUN} or "
            "more); record it again at a lower level, or leave these samples out: --allow-clipped, "
            "in a project allow_clipped: true"
        )
    return np.ascontiguousarray(channels[:, best])


def missing_bytes(path: str | Path) -> int:
    """Number of bytes of samples that a WAV file announces but lacks; 0 for any other file.

    Libraries read what there is, so half a recording would pass for a whole one.  Raises OSError if
    the file cannot be read.
    """
    size = os.path.getsize(path)
    with open(path, "rb") as file:
        head = file.read(_HEAD)
        if head[:4] != b"RIFF" or head[8:] != b"WAVE":
            return 0
        place = _HEAD
        for _ in range(MOST_CHUNKS):
            file.seek(place)
            name, length = file.read(4), int.from_bytes(file.read(4), "little")
            place += 8
            if place > size:
                break
            if name == b"data":
                return max(0, place + length - size) if length < UNKNOWN else 0
            place += length + length % 2
    return 0
