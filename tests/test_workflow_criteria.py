"""Every criterion of a validation refuses a spectrum that is damaged in just its way."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import yaml

from carillon.fem.model import RIGID_MODES, Solid
from solver import solve
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model
from solver.files.modes_file import write_modes
from solver.response import response_file
from solver.response.response_file import StrikeOptions, respond, write_response
from solver.verification.allowance import accepted_errors, angle_limits
from solver.verification.audit import audit_files
from solver.verification.comparison import compare_each
from tests.edited_files import edited
from tests.solids import box_mesh, random_box
from tests.test_solver_response import all_modes
from workflow import settings
from workflow.validation.criteria import judge, verdict
from workflow.validation.evidence import Evidence
from workflow.variants import FROM_SOLID, SHOWN, TRUTH

MODES, COARSE_MODES = 30, 24
TOLERANCE = 1e-7
LOOSE = {"frequency_rms": 10.0, "frequency_worst": 10.0}
"""So coarse a mesh does not come closer after coarsening."""
DISTANCE = {
    "solid_frequency_error_rms": 0.02,
    "solid_frequency_error_worst": 0.05,
    "solid_frequency_error_worst_mode": 8,
    "solid_frequency_error_modes": [7, 30],
}
FINE, COARSENED = (TRUTH, "hcms_ec"), "ddfem_hcms_ec"


JUDGED = (*FINE, COARSENED)


@dataclass(frozen=True)
class Spectrum:
    """Eigenpairs of a model, and the pair at the end of its whole spectrum."""

    model: Solid
    values: np.ndarray
    modes: np.ndarray
    top: float
    far: np.ndarray


@pytest.fixture(scope="module")
def spectra() -> dict[str, Spectrum]:
    """All variants of a box; the truth is LAPACK's."""
    model = random_box(6, 4, 3)
    coarse = build_model(box_mesh(6, 4, 3), model.young[:, 0], make_coarsening("average"))
    exact = by_lapack(model, MODES)
    found = solve(model, modes=MODES, method="hcms", tolerance=TOLERANCE)
    solved = replace(exact, values=found.eigenvalues, modes=found.modes)
    return {
        TRUTH: exact,
        "hcms": solved,
        "hcms_ec": solved,
        COARSENED: by_lapack(coarse, COARSE_MODES),
    }


def by_lapack(model: Solid, count: int) -> Spectrum:
    every = all_modes(model)
    values, modes = every.eigenvalues, every.modes
    return Spectrum(model, values[:count], modes[:, :count], values[-1], modes[:, -1])


@pytest.fixture(scope="module")
def config(tmp_path_factory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("config") / "config.yaml"
    given = {
        "models": {"box": {"mesh": "builtin:box", "resolution": 6}},
        "solver": {"tolerance": TOLERANCE},
        "validation": {"tolerances": LOOSE},
    }
    path.write_text(yaml.safe_dump(given))
    return settings.complete([path])


@pytest.fixture
def evidence(tmp_path, config, monkeypatch) -> Callable[..., Evidence]:
    """Makes all that a validation judges from spectra by variant, and limits by name."""
    # No criterion hears the sounds.
    monkeypatch.setattr(response_file, "spectral_distance", lambda *_: 0.0)

    def made(spectra: dict[str, Spectrum], **tolerances: float) -> Evidence:
        validation = config["validation"]
        limits = {**validation, "tolerances": validation["tolerances"] | tolerances}
        folder = tmp_path / "models" / "box"
        folder.mkdir(parents=True)
        paths = {variant: folder / f"{variant}.h5" for variant in SHOWN}
        for variant, part in spectra.items():
            attributes = DISTANCE if variant == FROM_SOLID else {}
            none = np.zeros(len(part.values))
            write_modes(paths[variant], part.model, part.values, [part.modes], none, attributes, {})
        compared = compare_each([paths[variant] for variant in SHOWN[1:]], paths[TRUTH])
        content = {"comparisons": {name: each.as_dict() for name, each in compared.items()}}
        (folder / "comparisons.json").write_text(json.dumps(content | {"provenance": {}}))
        audits = audit_files(paths.values(), TOLERANCE)
        content = {"spectra": {name: audit.as_dict() for name, audit in audits.items()}}
        (folder / "audit.json").write_text(json.dumps(content))
        candidates = {variant: paths[variant] for variant in SHOWN[1:]}
        struck = respond(paths[TRUTH], candidates, StrikeOptions())
        write_response(folder / "response.h5", struck, {})
        found = Evidence(tmp_path, "box")
        vars(found)["config"] = {**config, "validation": limits}
        return found

    return made


def missed(evidence: Evidence) -> set[tuple[str, str]]:
    return {(each.group, each.key) for each in judge(evidence) if not each.passed}


def changed(spectra: dict[str, Spectrum], variants: str | tuple[str, ...], change: Callable):
    """The spectra with copies of some, of which `change` damages values and modes in place."""
    variants = (variants,) if isinstance(variants, str) else variants
    damaged = dict(spectra)
    for variant in variants:
        part = spectra[variant]
        values, modes = part.values.copy(), part.modes.copy()
        kept = change(part, values, modes)
        if kept is not None:
            values, modes = values[kept], modes[:, kept]
        damaged[variant] = replace(part, values=values, modes=modes)
    return damaged


def left_out(part, values, modes):
    return np.delete(np.arange(len(values)), 10)


def shifted(part, values, modes):
    values[12] *= (1.0 + 1e-5) ** 2  # of its frequency


def too_large_a_residual(part, values, modes):
    """A little of the mode at the end: too little to spoil the shape, or the orthogonality."""
    share = 9e-5
    modes[:, 8] = np.sqrt(1.0 - share**2) * modes[:, 8] + share * part.far


def not_orthogonal(part, values, modes):
    modes[:, 8] *= 1.0 + 1e-7


def rigid_missing(part, values, modes):
    values[RIGID_MODES - 1] = 1e-3 * values[RIGID_MODES]


def rotated(angle: float, first: int, second: int) -> Callable:
    """Two shapes mixed, and their values left as they are."""

    def change(part, values, modes):
        rotation = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        modes[:, [first, second]] = modes[:, [first, second]] @ np.array(rotation)

    return change


def stands_twice(part, values, modes):
    values[11], modes[:, 11] = values[10], modes[:, 10]


def test_undamaged_spectra_pass(spectra, evidence):
    made = evidence(spectra)
    assert missed(made) == set()
    found = verdict(made)
    assert found["passed"] and found["wrong"] == [] and len(judge(made)) == 17
    assert "can be relied on" in found["advice"]


@pytest.mark.parametrize("variant", JUDGED)
@pytest.mark.parametrize(
    ("change", "key"),
    [
        (too_large_a_residual, "residual"),
        (not_orthogonal, "orthogonality"),
        (rigid_missing, "rigid"),
    ],
)
def test_a_damage_of_a_spectrum_is_refused_by_its_criterion_alone(
    change, key, variant, spectra, evidence
):
    made = evidence(changed(spectra, variant, change))
    assert missed(made) == {(variant, key)}
    found = verdict(made)
    if variant == TRUTH:
        assert found["wrong"] == ["Ground truth"] and "in doubt" in found["advice"]
    elif variant == "hcms_ec" and key != "rigid":
        assert found["wrong"] == [] and "Do not rely" not in found["advice"]
        assert (
            "Frequencies and shapes of HCMS + EC are those of the ground truth" in found["advice"]
        )
        assert [part["word"] for part in found["parts"]][1] == "the same, less exact"


@pytest.mark.parametrize("variants", [FINE, (COARSENED,)])
def test_a_mode_left_out_is_refused_by_the_count_alone(variants, spectra, evidence):
    """Also where the truth lacks the same one, as copies of a multiple eigenvalue may be missed."""
    made = evidence(changed(spectra, variants, left_out))
    assert missed(made) == {(variant, "counted") for variant in variants}
    wrong = "in doubt" if TRUTH in variants else "Do not rely on the coarsened solid"
    assert wrong in verdict(made)["advice"]


def test_a_mode_that_the_solver_alone_left_out_is_refused(spectra, evidence):
    made = evidence(changed(spectra, "hcms_ec", left_out))
    keys = {key for group, key in missed(made) if group == "hcms_ec"}
    assert keys >= {"counted", "eigenvalue_error", "subspace_angle"}
    found = verdict(made)
    assert found["wrong"] == ["HCMS + EC"]
    assert found["advice"].startswith("Do not rely on HCMS + EC for this solid and material")


def test_a_shifted_frequency_is_refused_by_its_error_alone(spectra, evidence):
    made = evidence(changed(spectra, "hcms_ec", shifted))
    assert missed(made) == {("hcms_ec", "eigenvalue_error")}
    (criterion,) = (each for each in judge(made) if not each.passed)
    assert criterion.label.endswith("mode 13") and criterion.wrong
    assert criterion.found == pytest.approx(2e-5, rel=0.02)


def test_a_shape_turned_a_little_is_refused_by_its_angle_alone(spectra, evidence):
    """Two neighbours, by twice of what their angles may be: residuals see the gap times that."""
    truth = spectra[TRUTH]
    first, second = 16, 17
    errors = accepted_errors(truth.values, np.zeros(MODES), TOLERANCE)
    limit = angle_limits(truth.values, errors, [(first + 1, first + 1)])[0]
    made = evidence(changed(spectra, "hcms_ec", rotated(2.0 * limit, first, second)))
    assert missed(made) == {("hcms_ec", "subspace_angle")}
    assert verdict(made)["wrong"] == ["HCMS + EC"]


def test_a_shape_turned_far_is_refused_by_all_that_shapes_tell_on(spectra, evidence):
    made = evidence(changed(spectra, "hcms_ec", rotated(0.2, 10, 14)))
    assert missed(made) >= {("hcms_ec", "subspace_angle"), ("hcms_ec", "residual")}


@pytest.mark.parametrize("variant", JUDGED)
def test_a_mode_that_stands_twice_is_refused(variant, spectra, evidence):
    assert (variant, "orthogonality") in missed(evidence(changed(spectra, variant, stands_twice)))


def test_a_motion_that_is_not_that_of_the_modes_is_refused_by_its_difference_alone(
    spectra, evidence
):
    made = evidence(spectra)
    with edited(made.folder / made.file("response.h5")) as file:
        motion = file["spectra/hcms_ec/displacement"]
        motion[...] = 1.5 * motion[()]
        file["spectra/hcms_ec"].attrs["difference"] = 0.5
    assert missed(made) == {("hcms_ec", "response")}
    found = verdict(made)
    assert found["wrong"] == [] and "lies in the computation of the motion" in found["advice"]


@pytest.mark.parametrize(
    ("key", "group", "says"),
    [
        ("frequency_rms", COARSENED, "these are not as close to the fine mesh as was asked for"),
        ("frequency_worst", COARSENED, "these are not as close to the fine mesh as was asked for"),
        ("solid_rms", "solid", "but these are not as close to the solid as was asked for"),
        ("solid_worst", "solid", "but these are not as close to the solid as was asked for"),
    ],
)
def test_what_is_right_but_not_close_is_refused_by_its_limit_alone(
    key, group, says, spectra, evidence
):
    made = evidence(spectra, **{key: 1e-3})
    assert missed(made) == {(group, key)}
    found = verdict(made)
    assert not found["passed"] and found["wrong"] == []
    assert says in found["advice"] and "Do not rely" not in found["advice"]


@pytest.mark.parametrize(
    "key",
    [
        "truth_residual",
        "residual",
        "orthogonality",
        "eigenvalue_error",
        "subspace_angle",
        "response",
    ],
)
def test_a_limit_that_is_set_takes_the_place_of_what_follows(key, spectra, evidence):
    """What misses it and is no more than the tolerance allows is not said to be wrong."""
    made = evidence(spectra, **{key: 1e-30})
    assert {found for _, found in missed(made)} == {key.removeprefix("truth_")}
    found = verdict(made)
    assert found["wrong"] == [] and "is what solver.tolerance allows" in found["advice"]
    assert "Do not rely" not in found["advice"]


def test_a_count_that_could_not_be_made_is_missed_and_no_doubt(spectra, evidence):
    made = evidence(spectra)
    for audit in made.audit["spectra"].values():
        audit["counted"] = None
    assert {key for _, key in missed(made)} == {"counted"}
    found = verdict(made)
    assert found["wrong"] == [] and "PETSc here lacks MUMPS" in found["advice"]
