"""Pictures and sounds that a page carries within itself."""

import io
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.io import wavfile

from carillon.drawing.solid import draw, mark
from carillon.fem.geometry import HexMesh
from carillon.files.atomic import atomic_path
from solver.response.response import FLOOR_DECIBELS, SAMPLE_RATE_HERTZ, decibels, spectrogram
from studies.base.colours import MUTED, themed
from studies.base.parts import data_uri
from studies.base.style import PNG_DPI, svg

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

PICTURE_INCHES = (3.4, 2.7)
COLOUR_MAP = "viridis"
"""Colour map of materials."""
ROOM_FOR_ARROW = 0.12
"""Share of the picture that its border takes where an arrow may reach beyond the solid."""
PEAK = 0.9
"""Level of the loudest sample, where 1 is the most that a sample can hold."""


def inlined(figure: Figure, name: str) -> Markup:
    """The figure as part of a page, in the page's own colours and font; it is closed."""
    source = themed(svg(figure, name))
    plt.close(figure)
    return Markup(source)


def pixels(figure: Any) -> Pixels:
    """The figure without background as RGBA values (h, w, 4); the figure is closed."""
    figure.set_dpi(PNG_DPI)
    figure.patch.set_alpha(0.0)
    figure.canvas.draw()
    values = np.array(figure.canvas.buffer_rgba())
    plt.close(figure)
    return values


def save_pixels(picture: Pixels, path: str | Path) -> None:
    """Write RGBA values (h, w, 4) as PNG."""
    with atomic_path(path) as temporary:
        matplotlib.image.imsave(temporary, np.ascontiguousarray(picture), format="png")


def marked_picture(
    mesh: HexMesh, marks: Iterable[tuple[Array, str, Array | None]], **look: Any
) -> Pixels:
    """The mesh, drawn with `look`, and marks on it: position, colour, direction of an arrow."""

    def draw_on(axes: Any) -> None:
        axes.computed_zorder = False
        draw(axes, mesh, **look)
        for position, colour, inward in marks:
            mark(axes, mesh, position, colour, inward, up=look["up"])

    return solid_picture(draw_on, ROOM_FOR_ARROW)


def solid_picture(draw_on: Callable[[Any], Any], border: float = 0.0) -> Pixels:
    """What `draw_on` draws on 3-D axes, with an empty border of that share of the picture."""
    figure = plt.figure(figsize=PICTURE_INCHES, layout="none")
    inside = 1.0 - 2.0 * border
    axes = figure.add_axes((border, border, inside, inside), projection="3d")
    draw_on(axes)
    axes.patch.set_alpha(0.0)
    return pixels(figure)


def cropped(pictures: Sequence[Pixels], margin: int = 12) -> list[Pixels]:
    """Cut the same empty border off all RGBA pictures (h, w, 4), but for `margin` pixels."""
    seen = np.any([picture[..., 3] > 0 for picture in pictures], axis=0)
    rows, columns = (np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0))
    top, left = max(rows[0] - margin, 0), max(columns[0] - margin, 0)
    window = np.s_[top : rows[-1] + margin + 1, left : columns[-1] + margin + 1]
    return [picture[window] for picture in pictures]


def embedded(picture: Pixels, **about: Any) -> dict[str, Any]:
    """RGBA values (h, w, 4) as a data URI with its size, and what else is said of them."""
    file = io.BytesIO()
    matplotlib.image.imsave(file, np.ascontiguousarray(picture), format="png")
    height, width, _ = picture.shape
    source = data_uri("image/png", file.getvalue())
    return {**about, "source": source, "height": height, "width": width}


def wav_uri(sound: Array, sample_rate: int, loudest: float) -> str:
    """A sound as a data URI: 16-bit mono WAV in which `loudest` is played at `PEAK`."""
    samples = np.clip(PEAK * sound / loudest, -1.0, 1.0)
    file = io.BytesIO()
    wavfile.write(file, sample_rate, np.round(32767 * samples).astype(np.int16))
    return data_uri("audio/wav", file.getvalue())


def spectrogram_figure(
    sound: Array, loudest: float, highest: float, rate: int = SAMPLE_RATE_HERTZ
) -> Figure:
    """Levels of a sound [dB] below the magnitude `loudest`, up to the frequency `highest` [Hz]."""
    times, hertz, magnitudes = spectrogram(sound, rate)
    shown = hertz <= highest
    levels = decibels(magnitudes[shown], loudest)
    with plt.rc_context({"axes.grid": False}):
        figure, axes = plt.subplots(figsize=(4.7, 2.9))
        extent = (1e3 * times[0], 1e3 * times[-1], 0.0, 1e-3 * hertz[shown][-1])
        shades: dict[str, Any] = {"vmin": FLOOR_DECIBELS, "vmax": 0.0, "cmap": "magma"}
        image = axes.imshow(levels, aspect="auto", origin="lower", extent=extent, **shades)
        figure.colorbar(image, ax=axes, label="level [dB]", pad=0.02).outline.set_edgecolor(MUTED)
        axes.set(xlabel="time [ms]", ylabel="frequency [kHz]", xlim=(0.0, extent[1]))
    return figure


def highest_hertz(sounds: Iterable[tuple[Array, int]]) -> float:
    """Frequency up to which sounds, each with its rate, reach, with room above; silence is none."""
    highest, limit = 0.0, np.inf
    for sound, rate in sounds:
        _, hertz, magnitudes = spectrogram(sound, rate)
        heard = (decibels(magnitudes, float(magnitudes.max())) > FLOOR_DECIBELS).any(axis=1)
        highest = max(highest, float(hertz[heard].max(initial=0.0)))
        limit = min(limit, float(hertz[-1]))
    return min(1.1 * highest + 200.0, limit)
