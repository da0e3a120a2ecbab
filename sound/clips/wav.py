"""Sound files: a clip of a strike in, a sound out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.files import atomic_path

Array = NDArray[np.float64]

FULL_SCALE = 0.9999
"""Magnitude from which on a sample is at the end of its format's range."""
CLIPPED_RUN = 4
"""Equal samples in a row at full scale that no unclipped sound has, but at very low frequencies."""
PEAK = 0.89
"""Largest magnitude of a normalised sound: 1 dB below full scale."""
_SUBTYPES = {"float": "FLOAT", "16 bit": "PCM_16"}


def read_wav(path: str | Path) -> tuple[Array, int]:
    """Samples (s,) of a sound file, the mean of its channels, full scale being 1; its rate [Hz].

    Raises
    ------
    UserError
        If the file is missing or not a sound file, or if it is empty, silent or clipped or has
        samples that are not finite numbers.
    """
    channels, rate = _channels(Path(path))
    if not len(channels):
        raise UserError(f"{path}: has no samples, expected the sound of a strike")
    bad = int((~np.isfinite(channels)).sum())
    if bad:
        raise UserError(
            f"{path}: has {bad} samples that are not finite numbers (NaN or infinite); repair or "
            "record it again"
        )
    if not channels.any():
        raise UserError(f"{path}: is silent, expected the sound of a strike")
    clipped = _clipped(channels)
    if clipped:
        raise UserError(
            f"{path}: is clipped ({clipped} samples at full scale, in runs of {CLIPPED_RUN} or "
            "more); record it again at a lower level"
        )
    samples = channels.mean(axis=1)
    if not samples.any():
        raise UserError(
            f"{path}: is silent once its channels are averaged, they cancel; turn one round first"
        )
    return samples, rate


def write_wav(
    path: str | Path, samples: Array, rate: int, sample_format: str = "float", peak: bool = False
) -> None:
    """Write one channel (s,) as WAV, atomically.

    Parameters
    ----------
    sample_format : "float" (32 bit) or "16 bit".
    peak : scale to the largest magnitude `PEAK`.

    Raises
    ------
    UserError
        If samples are not finite or beyond what 16 bits hold, or the file cannot be written.
    """
    import soundfile  # Slow to load.

    samples = np.asarray(samples, dtype=float)
    largest = float(np.abs(samples).max(initial=0.0))
    if not np.isfinite(largest):
        raise UserError(f"{path}: not written, the sound has samples that are not finite numbers")
    if peak and largest > 0.0:
        samples, largest = samples * (PEAK / largest), PEAK
    if sample_format == "16 bit" and largest > 1.0:
        raise UserError(
            f"{path}: not written, the sound reaches {largest:.3g} and 16 bits hold up to 1; "
            "normalise it or write floats"
        )
    with atomic_path(path) as temporary:
        soundfile.write(temporary, samples, rate, format="WAV", subtype=_SUBTYPES[sample_format])


def _channels(path: Path) -> tuple[Array, int]:
    import soundfile  # Slow to load.

    if not path.is_file():
        raise UserError(f"{path}: no such file, expected a sound clip (WAV)")
    try:
        channels, rate = soundfile.read(path, dtype="float64", always_2d=True)
    except (soundfile.LibsndfileError, OSError) as error:
        reason = str(error).rsplit(": ", 1)[-1].strip().rstrip(".")
        raise UserError(
            f"{path}: is not readable as a sound file ({reason}), expected a sound clip (WAV)"
        ) from None
    return channels, int(rate)


def _clipped(channels: Array) -> int:
    """Samples at full scale that are followed or preceded by enough equal ones."""
    total = 0
    for channel in channels.T:
        starts = np.flatnonzero(np.diff(channel, prepend=np.nan) != 0.0)
        lengths = np.diff(starts, append=len(channel))
        full = np.abs(channel[starts]) >= FULL_SCALE
        total += int(lengths[full & (lengths >= CLIPPED_RUN)].sum())
    return total
