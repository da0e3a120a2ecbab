"""Tables of the spectra of a run: errors against the ground truth, wall times, proofs."""

from collections.abc import Iterator

from solver.files.modes_file import FINE_TAKEN
from solver.refinement.errors import FROM_SOLID as DISTANCE
from studies.base.conditions import NOT_TIMED, ONE_COLD_RUN, measured
from studies.base.table import SOLID, Column, Row, each, hidden, solid, table
from workflow.report.results import FAST, Run, precomputation_seconds, records, solve_seconds
from workflow.variants import COARSENED as COARSENED
from workflow.variants import FROM_SOLID, TRUTH, VARIANTS
from workflow.variants import SHOWN as SHOWN

TIMED = (TRUTH, "ddfem_slepc", "hcms", "hcms_ec", FAST)
UNTIMED, ONE_RUN = measured(records, NOT_TIMED), measured(records, ONE_COLD_RUN)


def _identity(run: Run, model: str) -> Row:
    spectra = run.spectra[model]
    return {
        **solid(run, model),
        "unknowns": spectra[TRUTH].model.n_dofs,
        **({"coarse_unknowns": spectra[FAST].model.n_dofs} if FAST in spectra else {}),
    }


@table(
    SOLID,
    Column("unknowns", "Unknowns", "count"),
    Column("coarse_unknowns", "coarsened", "count"),
    Column("modes", "Modes", "count"),
    Column("hcms_error", "HCMS, worst eigenvalue", "percent"),
    Column("hcms_ec_error", "HCMS + EC, worst eigenvalue", "percent"),
    Column("ddfem_error", "DDFEM* + HCMS + EC, frequencies", "percent"),
    Column("solid_error", "fine mesh from the solid", "percent"),
    Column("truth_seconds", "SLEPc", "seconds"),
    Column("fast_seconds", "DDFEM* + HCMS + EC", "seconds"),
    Column("speed_up", "Speed-up", "times"),
    hidden("fine_taken", "Why it was not coarsened"),
    conditions=ONE_RUN,
)
def summary(run: Run) -> Iterator[Row]:
    """Every solid at a glance. Eigenvalue errors are relative to SLEPc on the fine mesh over all
    elastic modes; frequency errors of the coarsened mesh are root mean squares over modes 7–60, and
    so is what the fine mesh is expected to be off the solid itself. Times are wall seconds from the
    moduli to the modes; the speed-up's base is SLEPc. Where coarsening would not have paid, all
    unknowns are left."""
    for model, spectra in run.spectra.items():
        compared = run.comparisons[model]
        truth = solve_seconds(spectra[TRUTH])
        row = {
            **_identity(run, model),
            "modes": len(spectra[TRUTH].eigenvalues),
            "hcms_error": compared["hcms"]["eigenvalue_relative_error"]["max"],
            "hcms_ec_error": compared["hcms_ec"]["eigenvalue_relative_error"]["max"],
            "solid_error": spectra[FROM_SOLID].attributes.get(f"{DISTANCE}_rms"),
            "truth_seconds": truth,
        }
        if FAST in spectra:
            fast = solve_seconds(spectra[FAST])
            row |= {"fast_seconds": fast, "speed_up": truth / fast}
            row[FINE_TAKEN] = run.fine_taken(model)
            if row[FINE_TAKEN] is None:
                row["ddfem_error"] = compared[FAST]["frequency_rms_relative_error_7_60"]
        yield row


@table(
    Column("model", "Solid"),
    Column("mode", "Mode", "count"),
    Column("truth", "Ground truth", "hertz"),
    each(
        {variant: VARIANTS[variant].label for variant in SHOWN[1:]},
        Column("{name}", "{label}", "hertz"),
        Column("{name}_error", "error", "percent"),
    ),
    keys="model mode",
    conditions=UNTIMED,
)
def frequencies(run: Run) -> Iterator[Row]:
    """Natural frequencies [Hz] from the first elastic mode on, and their relative errors against
    SLEPc on the fine mesh."""
    for model, spectra in run.spectra.items():
        shown = run.shown_variants(model)
        count = min(len(spectra[variant].frequencies) for variant in shown)
        for index in range(spectra[TRUTH].model.rigid_modes, count):
            row = {variant: float(spectra[variant].frequencies[index]) for variant in shown}
            errors = {f"{name}_error": row[name] / row[TRUTH] - 1.0 for name in shown[1:]}
            yield {"model": model, "mode": index + 1, **row, **errors}


@table(
    Column("model", "Solid"),
    Column("variant", "Method"),
    Column("median", "Eigenvalue, median", "percent", source="eigenvalue_relative_error.median"),
    Column("p90", "90 % below", "percent", source="eigenvalue_relative_error.p90"),
    Column("max", "worst", "percent", source="eigenvalue_relative_error.max"),
    Column("rms_7_60", "Frequency, rms", "percent", source="frequency_rms_relative_error_7_60"),
    Column("max_7_60", "worst", "percent", source="frequency_max_relative_error_7_60"),
    Column("angle", "Largest angle", "angle", source="subspace_angle_max"),
    Column("compared", "Modes compared", "count", source="modes_compared"),
    keys="model variant",
    conditions=UNTIMED,
)
def errors(run: Run) -> Iterator[Row]:
    """Distance from SLEPc on the fine mesh: relative errors of eigenvalues over all elastic modes,
    of frequencies over modes 7–60, and the largest mass-weighted angle between the spaces of modes,
    clusters taken together; 90° means that modes changed places."""
    for model, compared in run.comparisons.items():
        for variant, distances in compared.items():
            yield {**distances, "model": model, "variant": VARIANTS[variant].label}


@table(
    SOLID,
    Column("unknowns", "Unknowns", "count"),
    Column("coarse_unknowns", "coarsened", "count"),
    each(
        COARSENED,
        Column(
            "{name}_rms",
            "{label}, rms",
            "percent",
            source="{name}.frequency_rms_relative_error_7_60",
        ),
        Column("{name}_max", "worst", "percent", source="{name}.frequency_max_relative_error_7_60"),
    ),
    conditions=UNTIMED,
)
def coarsening(run: Run) -> Iterator[Row]:
    """Relative errors of the frequencies of modes 7–60 after coarsening 2×2×2 voxels to one cell,
    against SLEPc on the fine mesh. All three solve the coarsened model by HCMS + EC. Blocks that
    DDFEM* keeps fine are counted among the unknowns of its model; where these are all, the fine
    solid was solved instead of one that DDFEM* coarsens."""
    for model, compared in run.comparisons.items():
        if FAST in compared:
            taken = run.fine_taken(model) is not None
            errors = {name: each for name, each in compared.items() if name != FAST or not taken}
            yield {**_identity(run, model), **errors}


@table(
    SOLID,
    Column("unknowns", "Unknowns", "count"),
    Column("coarse_unknowns", "coarsened", "count"),
    Column("precomputation", "Precomputation", "seconds"),
    Column("truth", "SLEPc (truth)", "seconds"),
    [Column(name, VARIANTS[name].label, "seconds") for name in TIMED[1:]],
    Column("speed_up", "Speed-up over SLEPc", "times"),
    conditions=ONE_RUN,
)
def times(run: Run) -> Iterator[Row]:
    """Wall seconds of one cold run each, with other runs beside it, from meshed solid and moduli to
    modes: coarsening, partition, assembly and solution count; voxels and material are
    precomputation; residuals, inertia and the distance from the solid are found off the clock.
    Methods that are timed alone, in turns, have a table of their own."""
    for model, spectra in run.spectra.items():
        timed = [variant for variant in TIMED if variant in spectra]
        seconds = {variant: solve_seconds(spectra[variant]) for variant in timed}
        yield {
            **_identity(run, model),
            "precomputation": precomputation_seconds(spectra[TRUTH]),
            **seconds,
            **({"speed_up": seconds[TRUTH] / seconds[FAST]} if FAST in seconds else {}),
        }


@table(
    Column("model", "Solid"),
    Column("variant", "Method"),
    Column("phase", "Phase"),
    Column("seconds", "Time", "seconds"),
    keys="model variant phase",
    conditions=ONE_RUN,
)
def phases(run: Run) -> Iterator[Row]:
    """Wall seconds of every phase of every run."""
    for model, variant, spectrum in run.solved:
        for phase, seconds in spectrum.attributes["timings"].items():
            label = VARIANTS[variant].label
            yield {"model": model, "variant": label, "phase": phase, "seconds": seconds}


@table(
    Column("model", "Solid"),
    Column("variant", "Method"),
    Column("residual_max", "2-norm residual", "small"),
    Column("orthogonality", "|XᵀMX − I|", "small"),
    Column("rigid_modes", "Rigid modes", "count"),
    Column("inertia", "Found / counted"),
    Column("corrections", "Corrections", "count"),
    Column("estimate", "Error estimate", "small"),
    Column("subdomains", "Subdomains", "count"),
    Column("ranks", "Ranks", "count"),
    Column("peak_memory_bytes", "Peak memory", "bytes"),
    keys="model variant",
    conditions=UNTIMED,
)
def evidence(run: Run) -> Iterator[Row]:
    """What every run proves about itself, from products with its own assembled matrices: the
    largest 2-norm residual |Kx − λMx| / (λ|Mx|), while validations judge energy residuals. The
    inertia of K − μM counts the eigenvalues below μ independently of the eigensolver: found equals
    counted when none is missed. The error estimate is the solver's own, from residuals."""
    for model, variant, spectrum in run.solved:
        attributes = spectrum.attributes
        counted = attributes.get("inertia_count", -1)
        uncorrected = 0 if attributes["method"] == "hcms" else None
        yield {
            **attributes,
            "model": model,
            "variant": VARIANTS[variant].label,
            "residual_max": float(spectrum.residuals.max()),
            "inertia": f"{attributes['inertia_expected']} / {counted}" if counted >= 0 else None,
            "corrections": attributes.get("corrections", uncorrected),
            "estimate": attributes.get("eigenvalue_error_estimate"),
        }
