"""Tables of a recording's page."""

from collections.abc import Iterator

import numpy as np

from studies.base.table import Column, Row, table
from studies.recordings.results import RecordingResults


@table(
    Column("mode", "Mode", "count"),
    Column("frequency", "Frequency [Hz]", "hertz"),
    Column("deviation", "Standard deviation [Hz]", "small", "Hz"),
    Column("damping", "Damping [1/s]", "fraction", "1/s"),
    Column("level", "Level [dB]", "fraction", "dB"),
)
def modes(results: RecordingResults) -> Iterator[Row]:
    """Modes that were found. Levels are those of the amplitudes at the strike, below the largest;
    the deviation is what the noise of the clip lets the frequency be uncertain by."""
    found = results.found
    amplitudes = np.array(found["amplitudes"][0])
    levels = 20.0 * np.log10(amplitudes / amplitudes.max())
    deviations = found["clips"][0]["frequency_deviations_hz"]
    columns = (found["frequencies_hz"], deviations, found["dampings_per_second"], levels.tolist())
    for number, values in enumerate(zip(*columns), 1):
        named = zip(("frequency", "deviation", "damping", "level"), values)
        yield {"mode": number, **dict(named)}


@table(
    Column("frequency", "Frequency [Hz]", "hertz"),
    Column("level", "Level [dB]", "fraction", "dB"),
)
def missed(results: RecordingResults) -> Iterator[Row]:
    """Strong peaks of the clip's spectrum that no mode accounts for."""
    peaks = results.peaks
    for index in np.flatnonzero(results.missed):
        yield {"frequency": float(peaks.hertz[index]), "level": float(peaks.decibels[index])}
