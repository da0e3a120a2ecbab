"""Tables of the page; their files are named after the model."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from studies.base.table import Column, Row, each, hidden, table
from workflow.composition import composition_of
from workflow.validation.criteria import judge
from workflow.validation.distance import distance_in_words
from workflow.validation.evidence import Evidence
from workflow.variants import FROM_SOLID, TRUTH, VARIANTS


@table(
    Column("group", "Spectrum"),
    Column("key", "Key"),
    Column("label", "Criterion"),
    Column("shown", "Found"),
    Column("required", "Required"),
    Column("verdict", "Verdict"),
    hidden("found", "Raw value"),
    hidden("limit", "Raw limit"),
    Column("why", "Why it matters"),
    Column("source", "Source"),
    keys="group key",
)
def criteria(evidence: Evidence) -> list[Row]:
    """Every criterion, what was found, what is required, and where the number lies."""
    return [criterion.row for criterion in judge(evidence)]


@table(
    Column("discretisation", "Discretisation"),
    Column("resolution", "Resolution", "count"),
    Column("unknowns", "Unknowns", "count"),
    Column("modes", "Modes"),
    Column("rms", "Distance, rms", "percent"),
    Column("worst", "worst", "percent"),
    Column("worst_mode", "at mode", "count"),
    hidden("told", "In words"),
    keys="discretisation resolution",
)
def solid(evidence: Evidence) -> Iterator[Row]:
    """Expected distance of the fine mesh's frequencies from those of the solid itself. Voxels are
    compared with finite cells on the same lattice; the error of these follows from what modes
    would gain if cells had more functions. Positive: too high."""
    settings, distance = evidence.settings, evidence.distance
    row = {
        "discretisation": settings["discretisation"],
        "resolution": settings["resolution"],
        "unknowns": evidence.shown[FROM_SOLID].model.n_dofs,
        "told": distance_in_words(evidence)["told"],
    }
    if distance:
        first, last = distance["modes"]
        row |= {**distance, "modes": f"{first}–{last}"}
    yield row


@table(
    Column("region", "Region"),
    Column("material", "Material"),
    Column("young", "E [GPa]", "fraction"),
    Column("poisson", "ν", "fraction"),
    Column("density", "Density [kg/m³]", "fraction"),
    Column("volume", "Volume [m³]", "small"),
    keys="region",
)
def regions(evidence: Evidence) -> Iterator[Row]:
    """What each region is made of: Young's modulus, before the material's factors and of wood the
    largest along its axes, Poisson's ratio of isotropic ones, and density."""
    model = evidence.shown[TRUTH].model
    entry = composition_of(evidence.config, evidence.model)
    named = {each.name: each.material for each in entry.regions}
    if not entry.regions:
        return
    table, names = model.regions, np.array(model.regions.names)
    for name in named:
        # Of wood whose axes vary there is a row for each direction.
        rows = np.flatnonzero(names == name)
        first, density = rows[0], table.density[rows[0]]
        denser = replace(table, density=np.where(names == name, 2.0, 1.0) * table.density)
        law = table.laws[first]
        kind = "isotropic" if law.poisson is not None else "with a grain"
        yield {
            "region": name,
            "material": f"{named[name] or 'given moduli'}, {kind}",
            "young": float(table.young[first]) / 1e9,
            "poisson": law.poisson,
            "density": float(density),
            "volume": (model.with_regions(denser).mass - model.mass) / float(density),
        }


@table(
    Column("mode", "Mode", "count"),
    Column("truth", "Ground truth", "hertz"),
    lambda evidence: each(
        {variant: VARIANTS[variant].label for variant in evidence.compared},
        Column("{name}", "{label}", "hertz"),
        Column("{name}_frequency", "error", "percent"),
        hidden("{name}_eigenvalue", "of the eigenvalue", "percent"),
    ),
    keys="mode",
)
def errors(evidence: Evidence) -> Iterator[Row]:
    """Natural frequencies [Hz] by mode number, and their relative errors against the ground truth.
    Eigenvalues err about twice as much; the file holds those of all modes."""
    spectra = evidence.shown
    truth = spectra[TRUTH]
    last = min(len(part.eigenvalues) for part in spectra.values())
    for index in range(truth.model.rigid_modes, last):
        row = {"mode": index + 1, TRUTH: float(truth.frequencies[index])}
        for variant in evidence.compared:
            spectrum = spectra[variant]
            row[variant] = float(spectrum.frequencies[index])
            row[f"{variant}_frequency"] = row[variant] / row[TRUTH] - 1.0
            ratio = spectrum.eigenvalues[index] / truth.eigenvalues[index]
            row[f"{variant}_eigenvalue"] = float(ratio) - 1.0
        yield row


@table(
    Column("method", "Method"),
    Column("clusters", "Clusters compared", "count"),
    Column("several", "of several modes", "count"),
    Column("median", "Median angle", "angle"),
    Column("largest", "Largest angle", "angle"),
    Column("modes", "in modes"),
    Column("likeness", "Likeness of the first elastic mode", "fraction"),
)
def shapes(evidence: Evidence) -> Iterator[Row]:
    """Mass-weighted angles between the ground truth's modes and each method's. Modes whose
    eigenvalues lie within 0.1 % of each other are a cluster and compared as one space. 90° means
    that a mode has changed places with another one."""
    first_mode = evidence.read_json(f"figures/{evidence.model}-mode.json")
    for variant in evidence.compared:
        clusters = evidence.compared[variant]["clusters"]
        row = {
            "method": VARIANTS[variant].label,
            "clusters": len(clusters),
            "likeness": first_mode[variant]["likeness"],
        }
        if clusters:
            worst = max(clusters, key=lambda cluster: cluster["angle"])
            alone = worst["first"] == worst["last"]
            row |= {
                "several": sum(cluster["last"] > cluster["first"] for cluster in clusters),
                "median": float(np.median([cluster["angle"] for cluster in clusters])),
                "largest": worst["angle"],
                "modes": str(worst["first"]) if alone else f"{worst['first']}–{worst['last']}",
            }
        yield row


@table(
    Column("method", "Method"),
    Column("unknowns", "Unknowns", "count"),
    Column("modes", "Modes", "count"),
    Column("residual_median", "2-norm residual, median", "small"),
    Column("residual_max", "largest", "small"),
    Column("energy_max", "Energy residual, largest", "small"),
    Column("orthogonality", "|XᵀMX − I|", "small"),
    Column("rigid_modes", "Rigid modes", "count"),
    Column("expected", "Found", "count"),
    Column("counted", "Counted", "count"),
    hidden("counted_below", "below", "small", "rad^2/s^2"),
    hidden("mass", "Mass", "small", "kg"),
)
def audits(evidence: Evidence) -> list[Row]:
    """Found anew from each modes file alone: K and M are assembled from the mesh and the moduli in
    the file by other code than the solver's own. Counted: eigenvalues below a value in a gap near
    the end, by the inertia of K − μM; found: those that the file holds. 2-norm residuals are |Kx −
    λMx| / (λ|Mx|), energy residuals √(rᵀ(K + sM)⁻¹r / λ); the criteria judge the latter."""
    spectra = evidence.audit["spectra"]
    return [
        {
            "method": VARIANTS[name].label,
            **spectra[name],
            "energy_max": max(spectra[name]["energy_residuals"]),
        }
        for name in evidence.shown
    ]


@table(
    Column("method", "Method"),
    Column("audible", "Modes heard", "count"),
    Column("peak", "Largest displacement [m]", "small", "m"),
    Column("difference", "Difference of motion", "percent"),
    Column("distance_decibels", "of sound [dB]", "small", "dB"),
)
def responses(evidence: Evidence) -> Iterator[Row]:
    """Motion and sound after a strike. Difference of motion: relative 2-norm of the difference to
    the ground truth over the time shown. Difference of sound: rms difference of the spectrograms
    where either is within 60 dB of the loudest."""
    for variant in evidence.shown:
        response = evidence.response.responses[variant]
        row = {
            "method": VARIANTS[variant].label,
            "audible": response.audible,
            "peak": float(np.linalg.norm(response.displacement, axis=1).max()),
        }
        if variant != TRUTH:
            row["difference"] = response.difference
            row["distance_decibels"] = response.distance_decibels
        yield row
