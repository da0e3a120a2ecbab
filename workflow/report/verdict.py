"""The verdict on the report's page: what a design takes, what it costs, how near spectra come."""

from collections.abc import Iterable
from functools import partial
from typing import Any

from markupsafe import Markup

from studies.base import parts
from studies.base.parts import grid, html, prose, unbroken
from studies.base.table import Row, Table
from workflow.report.findings import missed
from workflow.report.results import Run
from workflow.variants import VARIANTS

Tables = dict[str, Table]
Spread = tuple[float, float, float]
KINDS = {"voxel": "voxels", "finite-cell": "finite cells"}
"""Discretisations, in words."""
DESIGN_TILES = (
    (
        "{cold[0]:times}",
        """is how long SLEPc takes on the fine mesh beside the <b>cold solve of a
        design</b>{cold_of}; on the coarse mesh, at equal accuracy, {cold_same_of}""",
        "speed",
    ),
    (
        "{warm[0]:times}",
        """is how long SLEPc takes on the fine mesh beside a <b>warm solve</b>, which starts from
        the modes of a material 5 % apart{warm_of}; on the coarse mesh, at equal accuracy,
        {warm_same_of}""",
        "speed",
    ),
    (
        "{error[0]:percent}",
        """is the <b>error of both solves</b>: frequencies 7–60 of the coarse mesh against the fine
        one, rms{error_of}""",
        "ddfem_hcms_ec",
    ),
)
FINE_TILE = (
    "{fine[0]:times}",
    """is how long SLEPc takes beside <code>--method auto</code> on the same <b>fine mesh, at equal
    accuracy</b>, 10⁻⁶{fine_of}""",
    "hcms_ec",
)


def variant_name(variant: str) -> Markup:
    """A variant in its colour."""
    return parts.styled(variant, VARIANTS[variant].label)


def variants_key(names: Iterable[str]) -> Markup:
    """What the colours of variants stand for."""
    items = ((variant_name(name), VARIANTS[name].role) for name in names)
    return parts.key(items, "Methods and their colours")


def _of_solids(key: str, spread: Spread) -> str:
    """Least and greatest of the solids where they differ, behind the median if it stands alone."""
    median, least, most = (unbroken(e, "percent" if key == "error" else "times") for e in spread)
    same = key.endswith("_same")
    of = "" if same else ", median of the solids"
    ends = f"{of} ({least} to {most})" if spread[1] != spread[2] else ""
    return f"{median}{ends}" if same else ends


def design(run: Run, table: Table, design: dict[str, Any]) -> list[Any]:
    """The headline: what a design takes beside SLEPc."""
    chosen = [*(DESIGN_TILES if design["cold"] else ()), *([FINE_TILE] if design["fine"] else [])]
    of_solids = {f"{key}_of": _of_solids(key, spread) for key, spread in design.items() if spread}
    tiles = parts.tiles(*chosen, **design, **of_solids)
    if not table.rows:
        none = "No design was timed in this run; name models in <code>times.models</code>."
        return [tiles, prose(html(none))]
    times = run.config["times"]
    sizes = [row["unknowns"] for row in table.rows]
    faster = design["cold"][1] > 1 and design["warm"][1] > 1
    of_full = (
        ""
        if times["resolution"] or times["share"] == 1
        else (f", at {100 * times['share']:g} % of their resolution")
    )
    about = html(
        """A design changes the material of a solid and asks for its modes again, many times. What
        it solves each time, the mesh coarsened by regression forests and to an eigenvalue error of
        10⁻², was timed beside SLEPc, while nothing else of the run ran, and was {} faster on
        every solid. It is timed on the same solids with {} modes{} ({} unknowns); the spectra below
        are in full.{}""",
        "" if faster else Markup("<em>not</em>"),
        times["modes"],
        of_full,
        _counts((min(sizes), max(sizes))),
        """ On the coarse mesh itself SLEPc is not far from the cold solve: the gain is that of the
        coarse mesh, and of the modes before."""
        if design["cold_same"][0] < 2
        else "",
    )
    return [tiles, prose(about), grid(table)]


def _counts(ends: tuple[int, int]) -> str:
    return " to ".join(unbroken(each, "count") for each in dict.fromkeys(ends))


def costs(sentences: list[str]) -> list[Markup]:
    """What it costs, a bullet a sentence."""
    if not sentences:
        return []
    title = parts.element("h3", "What it costs, and where it does not pay")
    return [title, parts.div("prose", parts.bullets(sentences))]


def spectra(run: Run, tables: Tables, found: dict[str, Any]) -> list[Any]:
    """How near the spectra of all solids come to the ground truth."""
    solver = run.config["solver"]
    used = {model["discretisation"] for model in run.config["models"].values()}
    say = partial(html, tolerance=solver["tolerance"], **found)
    proven = (
        "<b>complete</b>: an inertia count finds no eigenvalue missing, and its largest 2-norm "
        "residual is {residual:small}"
        if found["proven"]
        else "<b>unproven</b>: an inertia count or its largest 2-norm residual, {residual:small}, "
        "contradicts it"
    )
    about = say(
        f"""Each solid was divided into {{}} with {{}} unknowns and given a material. SLEPc computed
        its lowest modes, the ground truth, which is {proven}. Hierarchical component mode synthesis
        (HCMS) then approximated the same modes from subdomains, to {{hcms_error:percent}} (worst
        eigenvalue of all solids), and error correction (EC) improved them until their estimated
        error fell below {{tolerance:small}}: the worst is off by {{hcms_ec_error:percent}}.""",
        " or ".join(words for name, words in KINDS.items() if name in used),
        _counts(found["unknowns"]),
    )
    left = ", ".join(run.titles[model] for model in run.models if run.fine_taken(model))
    none = f"No solid was coarsened, since that would not have paid: {left}." if left else ""
    second: Markup | str = ""
    if found["coarsened"]:
        goal = solver["refine_to"]
        kept = (
            f""" but for those that have to stay fine for an expected error of
            {100 * (goal or 0.05):g} %,"""
            if goal != 0
            else ""
        )
        none = say(
            """Last, regression forests replaced blocks of 2×2×2 voxels by one cell each
            (DDFEM*){}{} and the solid was solved in the same way: frequencies 7–60 are off by
            {ddfem_error:percent} (rms, median of {coarsened} solids, {ddfem_errors[0]:percent} to
            {ddfem_errors[1]:percent}). What remains of the error there is the price of the coarser
            mesh, not of the solver.{}{}""",
            "," if kept else "",
            kept,
            " Finite cells are not coarsened." if "finite-cell" in used else "",
            f" Not coarsened, since that would not have paid: {left}." if left else "",
        )
        closer = found["ddfem_error"] < min(found["average_error"], found["galerkin_error"])
        second = say(
            """On the same mesh, SLEPc took {fine_ratio:times} the time of HCMS + EC before
            coarsening and {coarse_ratio:times} after it. Coarsening by the forests was {} closer to
            the fine mesh than both averaging ({average_error:percent}) and Galerkin projection
            ({galerkin_error:percent}), medians of the same solids.""",
            "" if closer else Markup("<em>not</em>"),
        )
    names = ("truth", "hcms", "hcms_ec", "ddfem_hcms_ec", "ddfem_slepc")
    return [
        parts.element("h3", "Spectra"),
        prose(html("{} {}", about, none), second),
        variants_key(names if found["coarsened"] else names[:3]),
        grid(tables["summary"]),
        _missed(run, missed(tables["evidence"], solver["tolerance"])),
    ]


def _missed(run: Run, rows: list[Row]) -> Markup | str:
    if not rows:
        return ""
    sentence = "{variant} of {} reached {estimate:small} in {corrections} corrections"
    runs = html("; ").join(html(sentence, run.titles[row["model"]], **row) for row in rows)
    text = html(
        """The correction <em>missed</em> its tolerance of {:small} here: {}. These spectra are
        shown as they are.""",
        run.config["solver"]["tolerance"],
        runs,
    )
    return parts.element("p", text, class_="prose missed")
