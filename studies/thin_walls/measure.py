"""Errors of finite cells on thin walls, straight and turned against the lattice."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from carillon.command_line.progress import track
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from studies.accuracy.measure import summarised
from studies.accuracy.tetrahedra import missing, versions
from studies.thin_walls.cells import cell_spectrum, tried_cells
from studies.thin_walls.profiles import SECTIONS
from studies.thin_walls.references import COUNT, read_references
from studies.thin_walls.sizes import LEVELS, over_size
from studies.thin_walls.solids import STRAIGHT, TURNED, WalledSolid

AIMS = {"thin": (0.01, 0.03), "thick": (0.002, 0.006), "file": (0.01, 0.03)}
"""Aims of the root mean square error and of the worst, by kind of solid."""
MOST_UNKNOWNS = 60_000
"""Aim of the unknowns that this takes."""
LEGEND = (
    "at: resolution in the end; rms, worst: errors of the frequencies; expected: rms error that "
    "is told;\nlowest: least ratio of a frequency to the reference; cells by level: undivided, "
    "divided once, and so on"
)
"""What the columns of the text are."""
FACETS = "ring"
"""Solid whose surface is also made of twice as many sections."""


@parameters
class ThinWallOptions:
    """What is measured."""

    resolution: Annotated[int, between(4, 400)] = option(
        32, "lattice spacings along the longest side, at first"
    )
    accuracy: Annotated[float, between(0.0, 1.0)] = option(
        0.01,
        "expected error down to which resolutions are raised, of thick solids a fifth of it; "
        "0 leaves them",
    )
    levels: Annotated[int, between(0, LEVELS)] = option(
        3, "sizes of each discretisation, coarsest first; 0 leaves out errors over size"
    )


def measure_thin_walls(
    solids: Mapping[str, WalledSolid], options: ThinWallOptions
) -> dict[str, Any]:
    """Measure solids by name.

    Returns plain values: `solids`, an entry for each position, see `CellSpectrum.rated`; `levels`,
    see `over_size`, and their `summary`, see `studies.accuracy.measure.summarised`; `references`;
    `facets`, the change that twice as many sections make; `aims`; `without`, a sentence if there
    are no tetrahedra, and `packages`, versions of what made them.
    """
    known = read_references()
    references = {name: known[name] for name in solids if name in known}
    without = missing() if options.levels else ""
    # What is compiled or loaded when it is first used is not timed.
    cell_spectrum("builtin:box", 1.0, 8)
    resolution = options.resolution
    places = [(name, position) for name in solids for position in (STRAIGHT, TURNED)]
    found = [
        {"solid": name, "position": position}
        | tried_cells(
            solids[name],
            position,
            references.get(name),
            resolution,
            accuracy_for(solids[name].kind, options.accuracy),
        )
        for name, position in track(places, "solids")
    ]
    levels = [
        {"solid": name, **level}
        for name in track(list(references), "sizes")
        for level in over_size(
            solids[name], references[name], resolution, options.levels, not without
        )
    ]
    return {
        "elastic_modes": COUNT,
        "resolution": resolution,
        "accuracy": options.accuracy,
        "aims": AIMS,
        "most_unknowns": MOST_UNKNOWNS,
        "titles": {name: solid.title for name, solid in solids.items()},
        "kinds": {name: solid.kind for name, solid in solids.items()},
        "walls": {name: _relative_wall(solid) for name, solid in solids.items()},
        "references": {name: each.as_entry() for name, each in references.items()},
        "solids": found,
        "levels": levels,
        "summary": summarised(levels),
        "facets": facets(solids[FACETS], resolution) if FACETS in solids else None,
        "without": without,
        "packages": {} if without or not options.levels else versions(),
    }


def accuracy_for(kind: str, accuracy: float) -> float | None:
    """Accuracy that solids of a kind are asked for, in proportion to their aims; None of 0.

    Examples
    --------
    >>> accuracy_for("thin", 0.01), accuracy_for("thick", 0.01), accuracy_for("file", 0.0)
    (0.01, 0.002, None)
    """
    return accuracy * AIMS[kind][0] / AIMS["thin"][0] or None


def facets(solid: WalledSolid, resolution: int) -> dict[str, Any] | None:
    """Largest relative change of a frequency when a solid has twice as many sections.

    None if there is no spectrum.
    """
    once, twice = (
        tried_cells(solid, TURNED, None, resolution, refine_to=0.0, sections=sections)
        for sections in (SECTIONS, 2 * SECTIONS)
    )
    if "problem" in once or "problem" in twice:
        return None
    change = np.abs(np.array(twice["hertz"]) / np.array(once["hertz"]) - 1.0).max()
    return {"title": solid.title, "sections": SECTIONS, "change": float(change)}


def _relative_wall(solid: WalledSolid) -> float | None:
    return solid.wall / float(solid.surface().extents.max()) if solid.wall else None


def as_text(result: dict[str, Any]) -> str:
    """The result in columns."""
    lines = [
        f"{result['elastic_modes']} elastic frequencies of finite cells at resolution "
        f"{result['resolution']} and more, for an expected error of {result['accuracy']:g}, of "
        f"thick solids {accuracy_for('thick', result['accuracy']) or 0:g}",
        f"{'':<24}{'':<9}{'unknowns':>9}{'at':>5}{'seconds':>9}{'rms':>8}{'worst':>9}"
        f"{'expected':>9}{'lowest':>9}  cells by level",
    ]
    lines += [_line(result, found) for found in result["solids"]]
    lines.append(LEGEND)
    if result["summary"]:
        lines += ["", f"{'at equal unknowns, in equal time':<46}{'rate':>6}{'rms':>23}{'rms':>23}"]
    lines += [_summary_line(result, row) for row in result["summary"]]
    if result["facets"]:
        lines += [
            "",
            "{title}: twice {sections} sections of its surface change frequencies by {change:.1e} "
            "at most".format_map(result["facets"]),
        ]
    return "\n".join([*lines, *([result["without"]] if result["without"] else [])])


def _line(result: dict[str, Any], found: dict[str, Any]) -> str:
    start = f"{result['titles'][found['solid']]:<24}{found['position']:<9}"
    if "problem" in found:
        return f"{start}  {found['problem']}"
    start += f"{found['unknowns']:9,}{found['resolution']:5}{found['seconds']:9.1f}"
    expected = "-" if found["expected"] is None else f"{found['expected']:.2%}"
    levels = ", ".join(map(str, found["divided"]))
    if "rms" not in found:
        return f"{start}{'-':>8}{'-':>9}{expected:>9}{'-':>9}  {levels}"
    return (
        f"{start}{found['rms']:8.2%}{found['worst']:+9.2%}{expected:>9}{found['lowest']:9.4f}"
        f"  {levels}"
    )


def _summary_line(result: dict[str, Any], row: dict[str, Any]) -> str:
    start = f"{result['titles'][row['solid']]:<24}{row['discretisation']:<22}"
    rate = "-" if row["rate"] is None else f"{row['rate']:.1f}"
    texts = []
    for size, unit in (("unknowns", ""), ("seconds", " s")):
        error = row[f"error_at_{size}"]
        at = "" if row[size] is None else f" at {row[size]:,.3g}{unit}"
        texts.append(f"{'-' if error is None else f'{error:.2%}'}{at}")
    return f"{start}{rate:>6}{texts[0]:>23}{texts[1]:>23}"
