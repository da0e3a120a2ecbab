"""Tables of the study: the fastest method of every case, all methods, and all runs."""

from collections.abc import Iterator

import pandas as pd

from studies.base.conditions import Repeats, measured
from studies.base.numbers import show
from studies.base.table import MARK, Column, Row, hidden, table
from studies.crossover.results import Crossover
from studies.crossover.winners import AS_FAST, by_method
from studies.crossover.winners import fastest as fastest_of


def _repeats(study: Crossover) -> Repeats:
    return Repeats(f"the fastest of {study.part['runs']}, kernels compiled", "not told")


MEASURED = measured(lambda study: study.origins, _repeats)
PANEL = (
    hidden("machine", "Machine"),
    hidden("nodes", "Nodes", "count"),
    hidden("ranks", "Ranks", "count"),
    hidden("latency", "Latency", "seconds"),
    hidden("tolerance", "Tolerance", "small"),
)


@table(
    *PANEL,
    Column("title", "Solid"),
    Column("unknowns", "Unknowns", "count"),
    Column("modes", "Modes", "count"),
    hidden("method", "Method"),
    Column("label", "Fastest"),
    Column("seconds", "Time", "seconds"),
    Column("second", "Second"),
    Column("times_second", "second takes", "times"),
    Column("times_slepc", "SLEPc takes", "times"),
    Column("times_hcms_ec", "HCMS + EC takes", "times"),
    Column("times_hcms", "HCMS takes", "times"),
    Column("error", "its error", "small"),
    Column("auto", "auto chooses"),
    hidden(f"auto{MARK}", "mark of auto"),
    hidden("times_auto", "auto takes", "times"),
    keys="machine nodes ranks latency tolerance title unknowns modes",
    conditions=MEASURED,
)
def fastest(study: Crossover) -> Iterator[Row]:
    """The fastest of the methods whose eigenvalues are within the tolerance, its wall time from the
    moduli to the modes, and how many times as long others take; HCMS without correction whether it
    reaches the tolerance or not, with its largest eigenvalue error. Last, what --method auto
    chooses: green where nothing is faster by more than a tenth, else with its own ratio, or none if
    it missed the tolerance."""
    for row in _plain_rows(fastest_of(study.runs)):
        if row.get("auto") is not None:
            times = row.get("times_auto")
            good = times is not None and times <= AS_FAST
            row[f"auto{MARK}"] = "met" if good else "missed"
            row["auto"] += "" if good else f" {show(times, 'times')}"
        yield row


@table(
    hidden("method", "Method"),
    Column("label", "Method"),
    Column("runs", "Runs", "count"),
    Column("ended", "ended", "count"),
    Column("reached", "within the tolerance", "count"),
    Column("wins", "fastest", "count"),
    Column("times_median", "Time over the fastest, median", "times"),
    Column("times_worst", "largest", "times"),
)
def methods(study: Crossover) -> Iterator[Row]:
    """Every method over all cases in which one reached the tolerance: runs, those that came to an
    end, those within the tolerance, those that were the fastest; and, where it was within the
    tolerance, its time over that of the fastest."""
    return by_method(study.runs)


@table(
    hidden("machine", "Machine"),
    hidden("model", "Model"),
    Column("title", "Solid"),
    hidden("resolution", "Resolution", "count"),
    Column("unknowns", "Unknowns", "count"),
    Column("modes", "Modes", "count"),
    Column("nodes", "Nodes", "count"),
    Column("ranks", "Ranks", "count"),
    hidden("threads", "Threads of a rank", "count"),
    hidden("latency", "Latency", "seconds"),
    Column("tolerance", "Tolerance", "small"),
    hidden("method", "Method"),
    Column("label", "Method"),
    hidden("auto", "Chosen by auto"),
    Column("seconds", "Solution", "seconds"),
    Column("whole_seconds", "Whole", "seconds"),
    Column("processor_seconds", "Processor", "seconds"),
    Column("peak_memory_bytes", "Memory of a rank", "bytes"),
    Column("others", "Cores of others", "fraction"),
    Column("error", "Error", "small"),
    hidden("reference", "Error against"),
    Column("reached", "Reached"),
    hidden("problem", "Why not"),
    keys="machine model resolution modes nodes ranks latency tolerance method",
    conditions=MEASURED,
)
def runs(study: Crossover) -> Iterator[Row]:
    """Every run: wall seconds from the moduli to the modes (partition, analysis, assembly,
    solution; not the mesh before and the checks after), and of the whole process; processor seconds
    of all ranks with all that they do; largest peak memory of a rank; cores of the machine that
    other programs had meanwhile, without which a run would have been faster; the largest
    relative error of an eigenvalue against SLEPc to the smallest tolerance, or another method where
    SLEPc did not end, and whether it is within the tolerance. HCMS without correction runs once for
    all tolerances. SLEPc and ARPACK take the tolerance for that of a residual, whose square is
    about the error of an eigenvalue."""
    return _plain_rows(study.runs)


def _plain_rows(frame: pd.DataFrame) -> Iterator[Row]:
    """Rows with None for what is missing, and whole numbers where a column counts something."""
    counts = ("unknowns", "resolution", "threads", "modes", "ranks", "nodes")
    for row in frame.to_dict("records"):
        known = {str(key): None if pd.isna(value) else value for key, value in row.items()}
        yield {k: int(v) if k in counts and v is not None else v for k, v in known.items()}
