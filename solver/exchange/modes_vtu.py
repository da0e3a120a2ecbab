"""Modes for ParaView and PyVista: all of them as vectors, or the motion of one in phases."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.geometry.walls import WallSize
from carillon.fem.model import Solid
from carillon.files.atomic import atomic_path
from carillon.files.datasets import find, finite
from carillon.files.hdf5 import open_h5
from carillon.files.vtu import UnstructuredGrid, Vectors, write_vtu
from carillon.parameters import option, parameters
from carillon.parameters.quantities import Count, between
from solver.exchange.displayed import Displayed, displayed
from solver.files.modes_file import KIND, SCHEMA, ModesFile, read_modes

VTU, PVD = ".vtu", ".pvd"
"""Endings of a file of modes, and of a list of files over time."""
FREQUENCIES, RESIDUALS = "frequencies [Hz]", "residuals"
"""Arrays that belong to the whole."""
DISPLACEMENT = "displacement [m]"
_COLUMNS = 16


@parameters
class MotionOptions:
    """The motion of one mode as a series of files."""

    mode: Count | None = option(None, "mode that moves, counted from 1, rigid ones included")
    frames: Annotated[int, between(2, 10_000)] = option(24, "phases of one period")
    amplitude: Annotated[float, between(1e-9, 1e3)] = option(
        0.1, "largest displacement, as a share of the solid's longest side"
    )


@dataclass(frozen=True)
class StreamedModes:
    """Modes whose shapes are read as they are needed."""

    model: Solid
    frequencies: Array
    residuals: Array
    """(k,) [Hz] and residual ratios."""
    shapes: Callable[[int, int], Iterator[Array]]
    """Displacements (n, 3) of the modes from one to before another, counted from 0."""
    wall: WallSize | None = None
    up: str | None = None
    """The wall that the solid is, and the axis of its mesh that became z; see `ModesFile`."""

    @classmethod
    def of_file(cls, path: str | Path) -> "StreamedModes":
        """The modes in a file; raises UserError, see `solver.files.modes_file.read_modes`."""
        file = read_modes(path, with_modes=False)
        rows = file.model.n_dofs

        def shapes(first: int, stop: int) -> Iterator[Array]:
            with open_h5(path, KIND, SCHEMA, sealed=True, checked=True) as content:
                modes = find(content, "modes", (rows, len(file.eigenvalues)))
                for start in range(first, stop, _COLUMNS):
                    block = finite(content, "modes", modes[:, start : min(start + _COLUMNS, stop)])
                    for column in block.T:
                        yield column.reshape(-1, 3)

        return cls(file.model, file.frequencies, file.residuals, shapes, file.wall, file.up)

    @classmethod
    def of_contents(cls, file: ModesFile) -> "StreamedModes":
        """The modes that have been read."""
        modes = file.modes
        assert modes is not None

        def shapes(first: int, stop: int) -> Iterator[Array]:
            return (column.reshape(-1, 3) for column in modes[:, first:stop].T)

        return cls(file.model, file.frequencies, file.residuals, shapes, file.wall, file.up)

    def grid(self, shown: Displayed, points: Array | None = None) -> UnstructuredGrid:
        """The cells with their data, at other `points` (p, 3) [m] than theirs if given."""
        of_whole: dict[str, NDArray[Any]] = {
            FREQUENCIES: self.frequencies,
            RESIDUALS: self.residuals,
        }
        place = shown.points if points is None else points
        return UnstructuredGrid(place, shown.cells, shown.kind, shown.data, of_whole)


def write_all_modes(
    path: str | Path, spectrum: StreamedModes, shown: Displayed | None = None
) -> None:
    """Write a VTU file of the modes, a few of which are held at a time.

    It shows the cubes of the solid unless something else is given. Raises UserError if it cannot be
    written.
    """
    shown = displayed(spectrum.model) if shown is None else shown
    count = len(spectrum.frequencies)
    names = [
        f"mode {number}, {hertz:.4g} Hz" for number, hertz in enumerate(spectrum.frequencies, 1)
    ]
    values = (shown.vectors(shape) for shape in spectrum.shapes(0, count))
    write_vtu(path, spectrum.grid(shown), Vectors(names, values))


def write_motion(
    path: str | Path,
    spectrum: StreamedModes,
    motion: MotionOptions,
    shown: Displayed | None = None,
) -> list[Path]:
    """Write one period of a mode: a VTU file a phase, and the list of them (PVD), which is last.

    The cubes, or what else is `shown`, are moved; time is in periods. Returns the files of the
    phases. Raises UserError if there is no such mode, or a file cannot be written.
    """
    path, count = Path(path), len(spectrum.frequencies)
    if motion.mode is None or motion.mode > count:
        given = "none" if motion.mode is None else f"{motion.mode:,}"
        raise UserError(f"mode: found {given}, expected the number of one that moves, 1 to {count}")
    shown = displayed(spectrum.model) if shown is None else shown
    (shape,) = spectrum.shapes(motion.mode - 1, motion.mode)
    vectors = shown.vectors(shape)
    largest = float(np.sqrt((vectors**2).sum(axis=1).max(initial=0.0)))
    longest = float(np.ptp(shown.points, axis=0).max())
    vectors = vectors * (motion.amplitude * longest / largest if largest > 0.0 else 0.0)
    digits = len(str(motion.frames - 1))
    frames = [
        path.with_name(f"{path.stem}-{number:0{digits}}{VTU}") for number in range(motion.frames)
    ]
    for number, frame in enumerate(frames):
        moved = np.sin(2.0 * np.pi * number / motion.frames) * vectors
        grid = spectrum.grid(shown, shown.points + moved)
        write_vtu(frame, grid, Vectors([DISPLACEMENT], [moved]))
    _write_list(path, frames)
    return frames


def _write_list(path: Path, frames: Iterable[Path]) -> None:
    files = list(frames)
    lines = [
        f'<DataSet timestep="{number / len(files):.9g}" part="0" file={quoteattr(frame.name)}/>\n'
        for number, frame in enumerate(files)
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    with atomic_path(path) as temporary:
        temporary.write_text(f"{head}{''.join(lines)}</Collection>\n</VTKFile>\n")
