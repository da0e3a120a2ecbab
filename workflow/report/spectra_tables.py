"""Tables of the spectra of a run: errors against the ground truth, wall times, proofs."""

from __future__ import annotations

from collections.abc import Iterator

from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import FINE_TAKEN
from solver.refinement.errors import FROM_SOLID as DISTANCE
from studies.base.conditions import NOT_TIMED, ONE_COLD_RUN, measured
from studies.base.entry import Row
from workflow.report.results import FAST, Run, precomputation_seconds, records, solve_seconds
from workflow.variants import COARSENED as COARSENED
from workflow.variants import FROM_SOLID, TRUTH, VARIANTS
from workflow.variants import SHOWN as SHOWN

TIMED = (TRUTH, "ddfem_slepc", "hcms", "hcms_ec", FAST)
UNTIMED, ONE_RUN = measured(records, NOT_TIMED), measured(records, ONE_COLD_RUN)


def _identity(run: Run, model: str) -> Row:
    """Which solid a row is about, and how large it is."""
    spectra = run.spectra[model]
    return {
        "model": model,
        "title": run.titles[model],
        "unknowns": spectra[TRUTH].mesh.n_dofs,
        **({"coarse_unknowns": spectra[FAST].mesh.n_dofs} if FAST in spectra else {}),
    }


def summary(run: Run) -> Iterator[Row]:
    """One row a model: size, accuracy, time."""
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


def frequencies(run: Run) -> Iterator[Row]:
    """Frequency of every elastic mode by the variants that are shown, and its error."""
    for model, spectra in run.spectra.items():
        shown = run.shown_variants(model)
        count = min(len(spectra[variant].frequencies) for variant in shown)
        for index in range(RIGID_MODES, count):
            row = {variant: float(spectra[variant].frequencies[index]) for variant in shown}
            errors = {f"{name}_error": row[name] / row[TRUTH] - 1.0 for name in shown[1:]}
            yield {"model": model, "mode": index + 1, **row, **errors}


def errors(run: Run) -> Iterator[Row]:
    """Distances of every variant from the truth."""
    for model, compared in run.comparisons.items():
        for variant, distances in compared.items():
            yield {**distances, "model": model, "variant": VARIANTS[variant].label}


def coarsening(run: Run) -> Iterator[Row]:
    """What the coarsening alone costs in accuracy."""
    for model, compared in run.comparisons.items():
        if FAST in compared:
            taken = run.fine_taken(model) is not None
            errors = {name: each for name, each in compared.items() if name != FAST or not taken}
            yield {**_identity(run, model), **errors}


def times(run: Run) -> Iterator[Row]:
    """Wall time of every method on every model, as in Fig. 11 of the paper."""
    for model, spectra in run.spectra.items():
        timed = [variant for variant in TIMED if variant in spectra]
        seconds = {variant: solve_seconds(spectra[variant]) for variant in timed}
        yield {
            **_identity(run, model),
            "precomputation": precomputation_seconds(spectra[TRUTH]),
            **seconds,
            **({"speed_up": seconds[TRUTH] / seconds[FAST]} if FAST in seconds else {}),
        }


def phases(run: Run) -> Iterator[Row]:
    """Wall time by phase of every run."""
    for model, variant, spectrum in run.solved:
        for phase, seconds in spectrum.attributes["timings"].items():
            label = VARIANTS[variant].label
            yield {"model": model, "variant": label, "phase": phase, "seconds": seconds}


def evidence(run: Run) -> Iterator[Row]:
    """Residual, orthogonality, inertia count of every run."""
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
