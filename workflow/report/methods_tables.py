"""Tables of all methods timed in alternating runs (Fig. 11)."""

from collections.abc import Iterator, Mapping
from typing import Any

from studies.base.conditions import IN_COLUMNS, Repeats, measured
from studies.base.table import MAX, MIN, SOLID, Column, Row, each, hidden, solid, spread, table

METHODS = {
    "arpack": "ARPACK",
    "slepc": "SLEPc",
    "ddfem": "DDFEM*",
    "ddfem_rough": "DDFEM*, SLEPc to 10⁻²",
    "hcms": "HCMS",
    "hcms_ec": "HCMS + EC",
    "fastest": "Lanczos + EC",
    "slepc_rough": "SLEPc, 10⁻³",
    "fastest_rough": "Lanczos + EC, 10⁻³",
    "refined": "from DDFEM*, 10⁻³",
    "ddfem_ec_accurate": "DDFEM* + EC, 10⁻⁶",
    "ddfem_ec": "DDFEM* + EC",
    "ddfem_ec_warm": "the same, warm",
    "arpack_regular": "ARPACK, no factorisation",
    "scipy_superlu": "SciPy's ARPACK, SuperLU",
    "scipy_pardiso": "SciPy's ARPACK, PARDISO",
    "scipy_lobpcg": "SciPy's LOBPCG, PyAMG",
    "primme_direct": "PRIMME, factorisation",
    "primme_multigrid": "PRIMME, PyAMG",
    "slepc_lobpcg": "SLEPc's LOBPCG",
    "slepc_gd": "SLEPc's Davidson",
    "slepc_jd": "SLEPc's Jacobi-Davidson",
    "slepc_ciss": "SLEPc's contour integrals",
    "slepc_filter": "SLEPc's filter, lumped mass",
    "slepc_evsl": "EVSL, lumped mass",
}
"""Methods of `solver benchmark` and their names for people, in the table's order."""

MEASURED = measured(
    lambda results: {model: row["provenance"] for model, row in results.methods.items()},
    lambda results: Repeats(f"{_rounds(results.methods)}, all methods in turn", IN_COLUMNS),
)


def timed(results: Any) -> dict[str, str]:
    """Methods that were timed on any solid, and their names for people."""
    seconds = [row["seconds"] for row in results.methods.values()]
    return {name: METHODS[name] for name in METHODS if any(each.get(name) for each in seconds)}


def _rounds(rows: Mapping[str, Row], counted: str = "") -> str:
    """How often methods ran: most of them, then each that ran less often on any solid."""
    counts: dict[str, set[int]] = {}
    for row in rows.values():
        for name, count in row["runs"].items():
            counts.setdefault(name, set()).add(count)
    most = sorted({max(row["runs"].values()) for row in rows.values()})
    less = [
        f"{METHODS[name]} {' or '.join(map(str, sorted(counts[name])))}"
        for name in METHODS
        if counts.get(name, set(most)) != set(most)
    ]
    beside = f" ({', '.join(less)})" if less else ""
    return f"{' or '.join(map(str, most))}{counted}{beside}"


def _configurations(rows: Mapping[str, Row]) -> str:
    texts = []
    for model, row in rows.items():
        chosen = row["slepc_configuration"]
        of = len(row["slepc_configurations_tried"])
        tuned = f", the fastest of {of} tried" if of else ", its default"
        subspace = f"{chosen['subspace']:g} Lanczos vectors a mode"
        texts.append(f"{model} {chosen['package'].upper()}, {subspace}{tuned}")
    return "; ".join(texts) or "none"


@table(
    SOLID,
    Column("modes", "Modes", "count"),
    Column("dof_fine", "Unknowns", "count"),
    Column("dof_coarse", "coarsened", "count"),
    Column("precompute", "Precomputation", "seconds"),
    lambda results: each(timed(results), Column("{name}", "{label}", "seconds")),
    Column("hcms_error", "HCMS, worst eigenvalue", "percent", source="eigenvalue_error.hcms.max"),
    Column("hcms_ec_error", "HCMS + EC, worst", "percent", source="eigenvalue_error.hcms_ec.max"),
    Column(
        "ddfem_error",
        "DDFEM*, frequencies 7–60",
        "percent",
        source="frequency_error.ddfem.rms_7_60",
    ),
    Column("average_error", "Average, 7–60", "percent", source="frequency_error.average.rms_7_60"),
    lambda results: each(
        timed(results),
        hidden("{name}_min", "{label}, min", "seconds"),
        hidden("{name}_max", "{label}, max", "seconds"),
    ),
    conditions=MEASURED,
    rounds=lambda results: _rounds(results.methods, " rounds"),
    slepc=lambda results: _configurations(results.methods),
    failed=lambda results: "".join(
        f" {model}, {METHODS[name]}: {reason}."
        for model, row in results.methods.items()
        for name, reason in row["failed"].items()
    ),
)
def methods(results: Any) -> Iterator[Row]:
    """Median wall seconds of {rounds} in which each method runs once, from moduli to modes:
    coarsening, assembly and solution. Precomputation is what the meshes need once for any material,
    fine and coarse. Checks of the results are not timed. DDFEM* alone is coarsening and SLEPc on
    the coarse mesh, also to a residual of 10⁻². The warm run follows moduli that differ by a smooth
    field of 5 %, from the modes of the unchanged ones. EC goes on to an eigenvalue error of 10⁻⁶,
    coarsened to 10⁻² but where 10⁻⁶ is said, from modes of HCMS or, by block Lanczos, from random
    vectors; DDFEM* + EC takes the faster of these. Errors are against SLEPc on the fine mesh: the
    largest of an eigenvalue, and the rms of frequencies 7 to 60. SLEPc: {slepc}.{failed}"""
    for model, row in results.methods.items():
        yield {
            **row,
            **row["seconds"],
            **{f"{name}_{end}": ends[end] for name, ends in row["spread"].items() for end in ends},
            **solid(results, model),
        }


@table(
    SOLID,
    Column("method", "Method"),
    Column("runs", "Runs", "count"),
    spread("seconds", "Median", "seconds"),
    Column("error_median", "Error, median", "percent", source="median"),
    Column("error_p90", "90 % below", "percent", source="p90"),
    Column("error_max", "worst", "percent", source="max"),
    keys="model method",
    conditions=MEASURED,
)
def spreads(results: Any) -> Iterator[Row]:
    """The same runs one by one: median, least and greatest wall seconds, and errors of the elastic
    eigenvalues against SLEPc’s of the same operator, fine or coarse."""
    for model, row in results.methods.items():
        for name in (name for name in METHODS if name in row["spread"]):
            yield {
                **solid(results, model),
                "method": METHODS[name],
                "runs": row["runs"][name],
                "seconds": row["seconds"][name],
                **{f"seconds_{end}": value for end, value in row["spread"][name].items()},
                **row["eigenvalue_error"].get(name, {}),
            }


@table(
    SOLID,
    Column("method", "Method"),
    Column("base", "Base"),
    spread("ratio", "Speed-up", "times"),
    spread("with_precompute", "with precomputation", "times", shown=False),
    keys="model method base",
    conditions=MEASURED,
)
def ratios(results: Any) -> Iterator[Row]:
    """Speed-ups: median time of the base over that of the method. With precomputation, the time of
    the method includes what the mesh needs before its first solve, partition, sparsity and
    elimination plan, and that of the base does not; warm and later solves on the mesh need it no
    more. Min is the fastest run of the base over the slowest of the method, max the other way
    round."""
    parts = {"ratio": "speedup", "with_precompute": "speedup_with_precompute"}
    for model, row in results.methods.items():
        for method, bases in row["speedup"].items():
            for base in bases:
                values = {
                    f"{key}{end}": value
                    for key, part in parts.items()
                    for end, value in _ratio(row, method, base, row[part][method][base]).items()
                }
                names = {"method": METHODS[method], "base": METHODS[base]}
                yield {**solid(results, model), **names, **values}


def _ratio(row: Row, method: str, base: str, ratio: float) -> dict[str, float]:
    """A speed-up with its extremes: the fastest base over the slowest method, and vice versa.

    What the method needs beforehand, if that counts, is the same in both. A single run has none.
    """
    if min(row["runs"][method], row["runs"][base]) < 2:
        return {"": ratio}
    ours, others = row["spread"][method], row["spread"][base]
    before = row["seconds"][base] / ratio - row["seconds"][method]
    return {
        "": ratio,
        MIN: others["min"] / (ours["max"] + before),
        MAX: others["max"] / (ours["min"] + before),
    }
