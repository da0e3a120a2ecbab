"""Tables of the study: models and their verdicts, every frequency, where the data are from."""

from collections.abc import Iterator

from studies.base.conditions import NOT_TIMED, measured
from studies.base.numbers import show
from studies.base.table import Column, Row, hidden, table
from studies.measured.measure import CELLS, LABELS, WITHOUT
from studies.measured.results import MeasuredStudy, model_of

MEASURED = measured(lambda study: study.origins, NOT_TIMED)
SOLID = (hidden("solid", "Name"), Column("title", "Solid"))
FIRST = 6
"""Frequencies of a solid that waits which are shown."""


@table(
    *SOLID,
    Column("kind", "Frequencies"),
    hidden("model", "Kind of model"),
    Column("label", "Model"),
    Column("unknowns", "Unknowns", "count"),
    Column("compared", "Compared", "count"),
    Column("rms", "Rms error", "percent"),
    Column("mean", "Mean", "percent"),
    Column("worst", "Worst", "percent"),
    Column("mesh", "Of the mesh", "percent"),
    Column("uncertainty", "Of the data", "percent"),
    Column("verdict", "Verdict"),
    hidden("problem", "Why not"),
    keys="solid model",
    conditions=MEASURED,
)
def summary(study: MeasuredStudy) -> Iterator[Row]:
    """Errors of a model’s elastic frequencies against those that were measured or published,
    matched by index: root mean square, mean, and the worst. Beside them the rms error that the
    model expects of its mesh, and the one that the data are good for. An error that is larger than
    both together differs: constants, dimensions or frequencies are wrong, or the model is. Where
    more is expected of the mesh than of the data, a small error proves nothing. No mesh:
    polynomials over the whole solid (Rayleigh and Ritz), of whose error there is what lower degrees
    change."""
    for solid in study.rated:
        for model in solid["models"]:
            verdict = model.get("verdict") or ("no model" if "problem" in model else None)
            label = LABELS[model["model"]]
            yield {**solid, **model, "label": label, "verdict": verdict}


@table(
    *SOLID,
    Column("kind", "Frequencies"),
    Column("fitted", "Fitted constants", "count"),
    Column("constants", "Constants"),
    Column("uncertainty", "Data good for", "percent"),
    Column("why", "Since"),
    Column("conditions", "Conditions"),
    Column("source", "Source"),
)
def solids(study: MeasuredStudy) -> Iterator[Row]:
    """Where frequencies and constants are from. Fitted constants were found from the very
    frequencies that they are compared with: they test whether solid and model go together, not the
    constants."""
    for solid in study.measured["solids"]:
        source = solid["reference"] + (f" Read in: {solid['read_in']}." if solid["read_in"] else "")
        yield {**solid, "source": source}


@table(
    *SOLID,
    Column("left_out", "Waits, since"),
    Column("supports", "Supports"),
    Column("first", "First frequencies [Hz]"),
    Column("count", "Of", "count"),
)
def waiting(study: MeasuredStudy) -> Iterator[Row]:
    """Solids of which no model with a mesh is made, with the first frequencies in their files."""
    for solid in study.waiting:
        known = [hertz for hertz in solid["hertz"] if hertz is not None]
        first = ", ".join(show(hertz, "hertz") for hertz in known[:FIRST])
        yield {**solid, "first": first, "count": len(known)}


@table(
    *SOLID,
    Column("number", "Number", "count"),
    Column("given", "Given [Hz]", "hertz", "Hz"),
    Column("without", "No mesh [Hz]", "hertz", "Hz"),
    Column("without_error", "Error", "percent"),
    Column("cells", "Finite cells [Hz]", "hertz", "Hz"),
    Column("cells_error", "Error", "percent"),
    Column("cells_expected", "Of the mesh", "percent"),
    keys="solid number",
    conditions=MEASURED,
)
def frequencies(study: MeasuredStudy) -> Iterator[Row]:
    """Every elastic frequency that was measured or published, those computed, their relative
    errors, and how much too high the finite cells expect theirs to be."""
    for solid in study.rated:
        without, cells = (model_of(solid, kind) for kind in (WITHOUT, CELLS))
        for index, given in enumerate(solid["hertz"]):
            row = {"solid": solid["solid"], "title": solid["title"], "number": index + 1}
            row["given"] = given
            for name, model in (("without", without), ("cells", cells)):
                if model is not None:
                    row[name] = model["hertz"][index]
                    row[f"{name}_error"] = None if given is None else row[name] / given - 1.0
            if cells is not None and index < len(cells["expected"]):
                row["cells_expected"] = cells["expected"][index]
            yield row
