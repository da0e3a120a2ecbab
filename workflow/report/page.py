"""The report of a run as one page."""

from typing import Any

from markupsafe import Markup

from carillon.composition.entries import SupportEntry
from studies.base import parts
from studies.base.page import Section, StudyPage, listed_modes, origins, section
from studies.base.parts import grid, html, plot, prose, unbroken
from studies.base.table import Row, Table, read_table
from workflow.composition import composition_of
from workflow.report import verdict
from workflow.report.convergence_tables import convergence_sentences
from workflow.report.findings import findings, headline
from workflow.report.results import Run
from workflow.report.scaling_tables import assumptions
from workflow.report.verdict import variant_name
from workflow.variants import SHOWN, TRUTH, VARIANTS

Tables = dict[str, Table]


def page(run: Run, tables: Tables) -> StudyPage:
    """Build the page from the tables and figures of a run.

    Nothing is computed anew: every number comes from a table, so that page and tables agree.
    """
    results = findings(tables, run.config["solver"]["refine_to"])
    solids = len(run.models)
    return StudyPage(
        title=run.config["title"],
        kicker="report of a run",
        lede=html(
            """{} solid{} whose stiffness varies from voxel to voxel, {:count} vibration modes: how
            close does the fast spectrum come to the ground truth, and how much faster is it?""",
            solids,
            "s" * (solids > 1),
            results["elastic_modes"],
        ),
        sections=[
            section(
                "Verdict",
                *verdict.design(run, tables["design"], results["design"]),
                *verdict.costs(results["costs"]),
                *verdict.spectra(run, tables, results),
            ),
            section("Solids", *(_model(run, tables, model) for model in run.models)),
            _convergence(run, tables["convergence"]),
            section(
                "Coarsening",
                grid(tables["coarsening"]),
                grid(tables["errors"], by="model"),
            ),
            section("Forests", grid(tables["blocks"]), grid(tables["training"])),
            _times(run, tables),
            _scaling(run, tables["scaling"]),
            section("Evidence", grid(tables["evidence"], by="model")),
            origins(tables["provenance"], "config.yaml beside this page"),
        ],
    )


def material_facts(run: Run, model: str) -> list[Any]:
    """What a solid is made of and what holds it, in a few words."""
    entry, of_model = composition_of(run.config, model), run.config["models"][model]
    field, known = of_model["material"], run.config["poisson"]
    facts: list[Any] = [f"{field} material"]
    if entry.regions:
        named = (f"{each.name} of {each.material or 'given moduli'}" for each in entry.regions)
        factors = [] if field == "uniform" else [f"{field} factors on their moduli"]
        facts = [*named, *factors]
    else:
        density = html("<span>density {density:count} kg/m³</span>", **of_model)
        facts += [density, f"Poisson’s ratio {known}"]
    return [*facts, *map(support_in_words, entry.supports)]


def support_in_words(support: SupportEntry) -> str:
    """What holds a solid at one of its places."""
    place = f"where {support.where}"
    if support.at is not None:
        point = ", ".join(f"{part:g}" for part in support.at)
        within = "" if support.radius is None else f"within {support.radius:g} m of "
        place = f"{within or 'at '}({point}) m"
    along = "" if support.along == "xyz" else f" along {support.along}"
    if support.mass is not None:
        return f"{support.mass:g} kg {place}"
    if support.pad is not None:
        return f"on {1e3 * (support.thickness or 0.0):g} mm of {support.pad}{along} {place}"
    return f"{'held' if support.spring is None else 'on springs'}{along} {place}"


def mode_pictures(run: Run, model: str) -> Markup:
    """The first elastic mode by all variants that are shown."""
    described = run.read_json(f"figures/{model}-mode.json")
    first = described[TRUTH]["mode"]
    shown = []
    for variant in run.shown_variants(model):
        metadata = described[variant]
        source = parts.picture_uri(run.figure(f"{model}-mode-{variant}.png"))
        alt = f"{run.titles[model]}, mode {first} by {VARIANTS[variant].label}"
        known = "reference" if variant == TRUTH else f"likeness {metadata['likeness']:.4f}"
        picture = parts.image({**metadata, "source": source}, alt)
        line = html(
            "<p>{}<br>{hertz:hertz} Hz<br> {}</p>", variant_name(variant), known, **metadata
        )
        shown.append(picture + line)
    combined = described[TRUTH]["combined"]
    mixed = (
        f""" Modes {first}–{first - 1 + combined} lie within 5 % of each other, so any
        mixture of them is nearly a mode; of each method’s {combined} the mixture closest to the
        ground truth is shown."""
        if combined > 1
        else ""
    )
    about = f"""The first elastic mode (mode {first}), drawn with the same sign, amplitude and
        colours: dark is at rest, bright moves most. Likeness is the cosine between the motion shown
        and the ground truth’s; 1 is the same shape.{mixed}"""
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


def _model(run: Run, tables: Tables, model: str) -> Markup:
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
            *material_facts(run, model),
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
    if summary.get("fine_taken"):
        return ", not coarsened"
    if "coarse_unknowns" in summary:
        return f", coarsened {unbroken(summary['coarse_unknowns'], 'count')}"
    return " of finite cells"


def _judgement(run: Run, model: str) -> str:
    rows = read_table(run.folder / "validation" / "tables" / f"{model}-criteria.json").rows
    return headline(len(rows), sum(row["verdict"] != "met" for row in rows))


def _errors(run: Run, tables: Tables, model: str) -> list[Any]:

    def row(table: str, variant: str) -> Row:
        name = VARIANTS[variant].label
        (matching,) = tables[table].having({"model": model, "variant": name})
        return matching

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
    return section("Times", grid(tables["times"]), shown, *methods)


def _scaling(run: Run, table: Table) -> Section:
    none = html("Not measured in this run; name models in <code>scaling.models</code>.")
    shown = [scaling_plots(run), grid(table, by="model"), modelled(run)]
    return section(
        "Scaling over ranks",
        *(shown if run.scaling else [prose(none)]),
        menu="Scaling",
    )
