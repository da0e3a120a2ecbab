"""Tables of errors on single blocks."""

from types import SimpleNamespace

from studies.forests.study import FORESTS
from workflow.report.blocks_tables import LOWER_BOUND
from workflow.report.study import REPORT


def rated(method: str, high: float = 10.0, **changes) -> dict:
    """A row of `forests table`."""
    errors = {
        f"{kind}_error{load}": 0.5
        for kind in ("mean", "median")
        for load in ("", "_inertial", "_corner")
    }
    row = {
        "method": method,
        "range_gpa": [0.0, high],
        "distribution": "uniform",
        "fill": "solid",
        "scaled_by": 1.0,
        **errors,
        "min_mean_error": 0.4,
        "min_median_error": 0.3,
        "mean_squared_m2": 1e-12,
        "seconds_per_block": 1e-6,
        "seconds_per_block_min": 5e-7,
        "seconds_per_block_max": 4e-6,
        "timed_runs": 5,
        "storage_bytes": 100,
        "training_seconds": 2.0,
        "clamped": False,
        "blocks": 50,
        "seed": 0,
    }
    return row | changes


ROWS = [
    rated("average", storage_bytes=0),
    rated("database 0..10 GPa"),
    rated("average", high=10_000.0, storage_bytes=0, mean_error=0.7, seconds_per_block=3e-6),
    rated("database 0..10 GPa", high=10_000.0, clamped=True, mean_error=1e5),
    rated("database 0..10000 GPa", high=10_000.0, storage_bytes=200, training_seconds=None),
    rated("average", high=1e7, scaled_by=1e3),
]


RESULTS = SimpleNamespace(on_blocks={"result": ROWS, "provenance": {}}, config={})


def test_kinds_of_blocks_are_columns_and_databases_one_row():
    table = REPORT.entries["blocks"](RESULTS)
    rows = {row["method"]: row for row in table.rows}
    assert list(rows) == ["average", "database", LOWER_BOUND]
    assert (rows["average"]["kind0_nodal"], rows["average"]["kind1_nodal"]) == (0.5, 0.7)
    assert rows["average"]["seconds_per_block"] == 2e-6
    assert rows["average"]["seconds_per_block_min"] == 5e-7
    assert table.conditions["runs"].startswith("5 ")
    assert rows["database"]["kind1_nodal"] == 0.5, "not that beyond its range"
    assert (rows["database"]["storage_bytes"], rows["database"]["training_seconds"]) == (200, 2.0)
    assert rows[LOWER_BOUND]["kind0_nodal"] == 0.4
    labels = [column.label for column in table.shown]
    assert labels[1] == "0…10 GPa uniform, solid: nodal"
    assert not any("10,000,000" in label for label in labels)


def test_every_row_says_what_its_blocks_are():
    rows = FORESTS.entries["every-block"](RESULTS).rows
    assert len(rows) == len(ROWS)
    assert rows[0]["blocks"] == "0…10 GPa uniform, solid"
    assert rows[-1]["blocks"].endswith("(others times 1,000)")
