"""Claims about the convergence and the times of solves (Fig. 10, Fig. 11, Section 8.1)."""

from studies.base.numbers import show
from studies.base.table import Table
from studies.claims.findings import (
    EXACT,
    IN_PART,
    NOT,
    REPRODUCED,
    SIMILAR,
    UNMEASURED,
    Finding,
    ends,
    named,
)
from studies.claims.results import MEASURED, Claims
from workflow.report.convergence_tables import ACCELERATIONS, PAPER, RANDOM, SYNTHESIS, start_label

THREE_ORDERS, TWO_ORDERS = 1e3, 1e2
INTERACTIVE = 3.0
"""Time of a solve that the paper finds interactive [s]."""


def convergence(claims: Claims) -> Finding:
    """Fig. 10: corrections from HCMS and from random vectors."""
    table = claims.in_full("convergence") or claims.of_run("convergence")
    if not table.rows:
        return Finding(UNMEASURED, "No convergence was followed in this run.")
    sentences, agree = [], []
    for model in dict.fromkeys(row["model"] for row in table.rows):
        rows = [
            row
            for row in table.rows
            if row["model"] == model and row["acceleration"] == ACCELERATIONS[PAPER]
        ]
        last = max(row["corrections"] for row in rows)
        worst = {
            start: next(
                row["max"]
                for row in rows
                if row["start"] == start_label(start) and row["corrections"] == last
            )
            for start in (SYNTHESIS, RANDOM)
        }
        sentences.append(
            f"{rows[0]['title']}: {show(worst[SYNTHESIS], 'percent')} from HCMS, "
            f"{show(worst[RANDOM], 'percent')} from random vectors"
        )
        agree.append(worst[SYNTHESIS] < SIMILAR * worst[RANDOM])
    text = f"Worst eigenvalue after {last} over-relaxed corrections: {'; '.join(sentences)}."
    return Finding(REPRODUCED if all(agree) else NOT, text, (named(claims, table),))


def total(claims: Claims) -> Finding:
    """Fig. 11: all methods together."""
    design = claims.of_run("design")
    full = claims.in_full("methods")
    sentences, ratios, tuned = [], [], []
    for base, label in (("slepc", "tuned SLEPc"), ("arpack", "ARPACK in shift-and-invert mode")):
        cold, warm = (speed_ups(full, base, name) for name in ("ddfem_ec", "ddfem_ec_warm"))
        if cold and warm:
            sentences.append(f"{label}: {ends(cold)} cold, {ends(warm)} warm")
            ratios += [*cold, *warm]
            tuned += cold
    for row in claims.kept.values():
        seconds = row["seconds"]
        plain = seconds["arpack_regular"]
        cold, warm = [plain / seconds["ddfem_ec"]], [plain / seconds["ddfem_ec_warm"]]
        sentences.append(
            f"ARPACK without a factorisation, {show(plain, 'seconds')} for {row['modes']} modes of "
            f"the {row['model']} of {show(row['dof_fine'], 'count')} unknowns ({row['clock']}): "
            f"{ends(cold)} cold, {ends(warm)} warm"
        )
        ratios += [*cold, *warm]
    if design.rows:
        own = [(row["cold"], row["warm"]) for row in design.rows]
        cold, warm = ([float(each[number]) for each in own] for number in (0, 1))
        sentences.append(f"SLEPc in this run, smaller: {ends(cold)} cold, {ends(warm)} warm")
        ratios += [*cold, *warm]
        tuned += cold
    if not ratios:
        return Finding(UNMEASURED, "No design was timed in this run.")
    if tuned and min(tuned) >= THREE_ORDERS:
        verdict = REPRODUCED
    else:
        verdict = IN_PART if max(ratios) >= THREE_ORDERS else NOT
    kept = (MEASURED.name,) if claims.kept else ()
    own_table = ("tables/design.json",) if design.rows else ()
    of_full = (named(claims, full),) if full else ()
    return Finding(verdict, f"Faster than {'; '.join(sentences)}.", (*of_full, *kept, *own_table))


def each(claims: Claims) -> Finding:
    """Section 8.1: coarsening alone, and component mode synthesis with correction alone."""
    full = claims.in_full("methods") or claims.of_run("methods")
    names = {"ddfem": "DDFEM* alone", "hcms_ec": EXACT, "fastest": "--method auto"}
    ratios = {name: speed_ups(full, "slepc", name) for name in names}
    sentences = [f"{names[name]} {ends(values)}" for name, values in ratios.items() if values]
    if not sentences:
        return Finding(UNMEASURED, "Methods were not timed in this run.")
    verdict = (
        REPRODUCED
        if all(min(ratios[name] or [0.0]) >= TWO_ORDERS for name in ("ddfem", "hcms_ec"))
        else NOT
    )
    return Finding(verdict, f"Over SLEPc: {', '.join(sentences)}.", (named(claims, full),))


def interactive(claims: Claims) -> Finding:
    """Section 8.1: seconds of a solve."""
    full = claims.in_full("methods") or claims.of_run("methods")
    cold, warm = (
        [row[name] for row in full.rows if row.get(name) is not None]
        for name in ("ddfem_ec", "ddfem_ec_warm")
    )
    if not cold or not warm:
        return Finding(UNMEASURED, "No design was timed in this run.")
    text = f"{ends(cold, 'seconds')} cold, {ends(warm, 'seconds')} warm."
    verdict = REPRODUCED if max(cold) <= INTERACTIVE else NOT
    return Finding(verdict, text, (named(claims, full),))


def speed_ups(table: Table | None, base: str, method: str) -> list[float]:
    """Time of a base over that of a method, of every solid that both were timed on."""
    rows = table.rows if table else ()
    return [row[base] / row[method] for row in rows if row.get(base) and row.get(method)]
