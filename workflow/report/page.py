"""The report of a run as one page."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

from markupsafe import Markup

from studies.base import parts
from studies.base.page import Section, StudyPage, listed_modes, origins, section
from studies.base.parts import grid, html, plot, prose, unbroken
from studies.base.table import Row, Table, read_table
from workflow.report.convergence_tables import convergence_sentences
from workflow.report.findings import findings, headline, missed
from workflow.report.results import Run
from workflow.report.scaling_tables import assumptions
from workflow.variants import SHOWN, TRUTH, VARIANTS

Tables = dict[str, Table]
Spread = tuple[float, float, float]
KINDS = {"voxel": "voxels", "finite-cell": "finite cells"}
"""Discretisations, in words."""


def page(run: Run, tables: Tables) -> StudyPage:
    """Build the page from the tables and figures of a run.

    Nothing is computed anew: every number comes from a table, so that page and tables agree.
    """
    found = findings(tables, run.config["solver"]["refine_to"])
    solids = len(run.models)
    return StudyPage(
        title=run.config["title"],
        kicker="report of a run",
        lede=html(
            """{} solid{} whose stiffness varies from voxel to voxel, {:count} vibration modes: how
            close does the fast spectrum come to the ground truth, and how much faster is it?""",
            solids,
            "s" * (solids > 1),
            found["elastic_modes"],
        ),
        sections=[
            section(
                "verdict",
                "Verdict",
                *_design(run, tables["design"], found["design"]),
                *_costs(found["costs"]),
                *_spectra(run, tables, found),
            ),
            section("solids", "Solids", *(_model(run, tables, model) for model in run.models)),
            _convergence(run, tables["convergence"]),
            section(
                "coarsening",
                "Coarsening",
                grid(tables["coarsening"]),
                grid(tables["errors"], by="model"),
            ),
            section("forests", "Forests", grid(tables["blocks"]), grid(tables["training"])),
            _times(run, tables),
            _scaling(run, tables["scaling"]),
            section("evidence", "Evidence", grid(tables["evidence"], by="model")),
            origins(tables["provenance"], "config.yaml beside this page"),
        ],
    )


def variant_name(variant: str) -> Markup:
    """A variant in its colour."""
    return parts.styled(variant, VARIANTS[variant].label)


def variants_key(names: Iterable[str]) -> Markup:
    """What the colours of variants stand for."""
    items = ((variant_name(name), VARIANTS[name].role) for name in names)
    return parts.key(items, "Methods and their colours")


def mode_pictures(run: Run, model: str) -> Markup:
    """The first elastic mode by all variants that are shown."""
    described = run.read_json(f"figures/{model}-mode.json")
    shown = []
    for variant in run.shown_variants(model):
        told = described[variant]
        source = parts.picture_uri(run.figure(f"{model}-mode-{variant}.png"))
        alt = f"{run.titles[model]}, mode 7 by {VARIANTS[variant].label}"
        known = "reference" if variant == TRUTH else f"likeness {told['likeness']:.4f}"
        picture = parts.image({**told, "source": source}, alt)
        line = html("<p>{}<br>{hertz:hertz} Hz<br> {}</p>", variant_name(variant), known, **told)
        shown.append(picture + line)
    combined = described[TRUTH]["combined"]
    mixed = (
        f""" Modes 7–{6 + combined} lie within 5 % of each other, so any mixture of them is nearly
        a mode; of each method’s {combined} the mixture closest to the ground truth is shown."""
        if combined > 1
        else ""
    )
    about = f"""The first elastic mode (mode 7), drawn with the same sign, amplitude and colours:
        dark is at rest, bright moves most. Likeness is the cosine between the motion shown and the
        ground truth’s; 1 is the same shape.{mixed}"""
    return parts.figure(parts.pictures(shown), caption=about)


def convergence_plots(results: Any, table: Table, steps: int) -> Markup:
    """How corrections converge: what the table says, and a figure a solid."""
    about = """{}: eigenvalues above and their relative errors below, after up to {} corrections
        from every start; over-relaxed corrections as in the paper in the upper row,
        Krylov-accelerated ones in the lower, whose shift follows the start’s own values. Errors
        below 10⁻¹² are drawn there."""
    names = [f"{name}-convergence" for name in results.convergence]
    return parts.together(
        prose(*convergence_sentences(table)),
        *(
            plot(results.drawn(file), html(about, results.titles[name], steps), file)
            for name, file in zip(results.convergence, names)
        ),
    )


def scaling_plots(results: Any) -> Markup:
    """Wall time over ranks, a figure a solid."""
    about = "{}: lines are the model, dots measured, hollow on more ranks than cores."
    return parts.together(
        *(
            plot(
                results.drawn(f"{name}-scaling"),
                html(about, results.titles[name]),
                f"{name}-scaling",
            )
            for name in results.scaling
        )
    )


def modelled(results: Any) -> Markup:
    """What the model of times on ranks takes for granted."""
    about = """Times on ranks that were not measured are those of a model, not of a machine. The
        model takes for granted:"""
    return parts.div("prose", parts.element("p", about), parts.bullets(assumptions(results)))


def _ranged(spread: Spread, kind: str, of: str = "", value: bool = True) -> str:
    """Median of the solids, and least and greatest where they differ."""
    median, least, most = (unbroken(each, kind) for each in spread)
    ends = f"{of} ({least} to {most})" if spread[1] != spread[2] else ""
    return f"{median if value else ''}{ends}"


def _design(run: Run, table: Table, design: dict[str, Any]) -> list[Any]:
    """The headline: what a design takes beside SLEPc."""

    def of_solids(key: str, kind: str = "times") -> str:
        return _ranged(design[key], kind, ", median of the solids", value=False)

    def same(key: str) -> str:
        return f"on the coarse mesh, at equal accuracy, {_ranged(design[key], 'times')}"

    items = []
    if design["cold"]:
        items += [
            (
                unbroken(design["cold"][0], "times"),
                html(
                    """is how long SLEPc takes on the fine mesh beside the <b>cold solve of a
                    design</b>{}; {}""",
                    of_solids("cold"),
                    same("cold_same"),
                ),
                "speed",
            ),
            (
                unbroken(design["warm"][0], "times"),
                html(
                    """is how long SLEPc takes on the fine mesh beside a <b>warm solve</b>, which
                    starts from the modes of a material 5 % apart{}; {}""",
                    of_solids("warm"),
                    same("warm_same"),
                ),
                "speed",
            ),
            (
                unbroken(design["error"][0], "percent"),
                html(
                    """is the <b>error of both solves</b>: frequencies 7–60 of the coarse mesh
                    against the fine one, rms{}""",
                    of_solids("error", "percent"),
                ),
                "ddfem_hcms_ec",
            ),
        ]
    if design["fine"]:
        about = """is how long SLEPc takes beside <code>--method auto</code> on the same <b>fine
            mesh, at equal accuracy</b>, 10⁻⁶{}"""
        figure = unbroken(design["fine"][0], "times")
        items.append((figure, html(about, of_solids("fine")), "hcms_ec"))
    if not table.rows:
        none = "No design was timed in this run; name models in <code>times.models</code>."
        return [parts.tiles(*items), prose(html(none))]
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
        10⁻², was timed beside SLEPc, alone on the machine, and was {} faster on every solid. It is
        timed on the same solids with {} modes{} ({} unknowns); the spectra below are in full.{}""",
        "" if faster else Markup("<em>not</em>"),
        times["modes"],
        of_full,
        _counts((min(sizes), max(sizes))),
        """ On the coarse mesh itself SLEPc is not far from the cold solve: the gain is that of the
        coarse mesh, and of the modes before."""
        if design["cold_same"][0] < 2
        else "",
    )
    return [parts.tiles(*items), prose(about), grid(table)]


def _counts(ends: tuple[int, int]) -> str:
    return " to ".join(unbroken(each, "count") for each in dict.fromkeys(ends))


def _costs(sentences: list[str]) -> list[Markup]:
    if not sentences:
        return []
    title = parts.element("h3", "What it costs, and where it does not pay")
    return [title, parts.div("prose", parts.bullets(sentences))]


def _spectra(run: Run, tables: Tables, found: dict[str, Any]) -> list[Any]:
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
    """Runs whose correction missed its tolerance."""
    if not rows:
        return ""
    told = "{variant} of {} reached {estimate:small} in {corrections} corrections"
    runs = html("; ").join(html(told, run.titles[row["model"]], **row) for row in rows)
    text = html(
        """The correction <em>missed</em> its tolerance of {:small} here: {}. These spectra are
        shown as they are.""",
        run.config["solver"]["tolerance"],
        runs,
    )
    return parts.element("p", text, class_="prose missed")


def _model(run: Run, tables: Tables, model: str) -> Markup:
    """What is known of a solid."""
    title, settings = run.titles[model], run.config["models"][model]
    (summary,) = tables["summary"].having({"model": model})
    frequencies = tables["frequencies"].having({"model": model})
    absent = [name for name in SHOWN if name not in run.shown_variants(model)]
    skip = ["model", *(column for name in absent for column in (name, f"{name}_error"))]
    about = """Frequencies by mode number, and their relative errors against SLEPc on the fine mesh.
        Errors of HCMS + EC end where SLEPc’s own tolerance does."""
    return parts.article(
        f"model-{model}",
        title,
        parts.facts(
            settings["mesh"],
            f"resolution {settings['resolution']}",
            f"{settings['material']} material",
            html("<span>density {density:count} kg/m³</span>", **settings),
            f"Poisson’s ratio {run.config['poisson']}",
            html("<span>{unknowns:count} unknowns{}</span>", _coarse(summary), **summary),
            f"{summary['modes']} modes",
        ),
        parts.facts(
            html('<a href="validation/{}.html">Validation</a>', model), _judgement(run, model)
        ),
        mode_pictures(run, model),
        parts.div(
            "pair",
            plot(run.drawn(f"{model}-spectrum"), about, width=""),
            grid(tables["frequencies"], listed_modes(frequencies), skip),
        ),
        parts.element("p", *_errors(run, tables, model), class_="proof"),
    )


def _coarse(summary: Row) -> str:
    """What became of the unknowns of a solid."""
    if summary.get("fine_taken"):
        return ", not coarsened"
    if "coarse_unknowns" in summary:
        return f", coarsened {unbroken(summary['coarse_unknowns'], 'count')}"
    return " of finite cells"


def _judgement(run: Run, model: str) -> str:
    """How the model's validation ended, in a sentence."""
    rows = read_table(run.folder / "validation" / "tables" / f"{model}-criteria.json").rows
    return headline(len(rows), sum(row["verdict"] != "met" for row in rows))


def _errors(run: Run, tables: Tables, model: str) -> list[Any]:
    """Errors of the variants of a solid, and what two of them prove about themselves."""

    def row(table: str, variant: str) -> Row:
        name = VARIANTS[variant].label
        (found,) = tables[table].having({"model": model, "variant": name})
        return found

    error = """{variant}: eigenvalues median {median:percent}, worst {max:percent}; frequencies 7–60
        rms {rms_7_60:percent}."""
    truth = """Ground truth: 2-norm residuals below {residual_max:small}, mass-orthonormal to
        {orthogonality:small}, {rigid_modes} rigid modes, eigenvalues found and counted
        {inertia}."""
    corrected = """HCMS + EC: {corrections} corrections in {subdomains} subdomains, own error
        estimate {estimate:small}, mass-orthonormal to {orthogonality:small}."""
    return [
        parts.element("b", "Errors."),
        *(html(error, **row("errors", name)) for name in run.shown_variants(model)[1:]),
        parts.element("b", "Evidence."),
        html(truth, **row("evidence", TRUTH)),
        html(corrected, **row("evidence", "hcms_ec")),
    ]


def _convergence(run: Run, table: Table) -> Section:
    shown: list[Any] = [
        convergence_plots(run, table, run.config["convergence"]["steps"]),
        grid(table, by="start"),
    ]
    none = html("Not computed in this run; name models in <code>convergence.models</code>.")
    return section(
        "convergence",
        "Convergence of the error correction",
        *(shown if run.convergence else [prose(none)]),
        menu="Convergence",
    )


def _times(run: Run, tables: Tables) -> Section:
    single = html("""Wall times of the table above; the axis is logarithmic. Times of single phases:
        <span class="file">tables/phases.csv</span>""")
    rounds = html("""Medians of the table above, with least and greatest; the axis is logarithmic.
        The same for more and larger solids: <code>snakemake figures</code>.""")
    none = """Alternating runs of all methods were not made; name models in
        <code>times.models</code>."""
    methods = [prose(html(none))]
    if tables["methods"].rows:
        methods = [
            parts.element("h3", "Methods in alternating runs"),
            grid(tables["methods"]),
            plot(run.drawn("methods"), rounds),
            grid(tables["ratios"], by="method"),
            grid(tables["spreads"], by="model"),
        ]
    shown = plot(run.drawn("times"), single)
    return section("times", "Times", grid(tables["times"]), shown, *methods)


def _scaling(run: Run, table: Table) -> Section:
    none = html("Not measured in this run; name models in <code>scaling.models</code>.")
    shown = [scaling_plots(run), grid(table, by="model"), modelled(run)]
    return section(
        "scaling",
        "Scaling over ranks",
        *(shown if run.scaling else [prose(none)]),
        menu="Scaling",
    )
