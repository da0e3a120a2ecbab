"""Coarsenings judged by what matters: the frequencies of a free body."""

import numpy as np
import pytest

from dataset_gen.generate import generate
from dataset_gen.objectives import DEFAULT_OBJECTIVE, fit, lumped_share
from dataset_gen.settings import ShardOptions
from forests import coarsen
from forests.baselines import average, galerkin
from forests.training.options import TrainingOptions
from tests.dataset_spectra import box_fields, coarse_frequencies, fine_frequencies, rms_error
from tests.small_forests import train

MODES = 30


@pytest.fixture(scope="module")
def model():
    return train(
        [generate(ShardOptions(8000, seed=1), progress=False)], TrainingOptions(), progress=False
    )


@pytest.fixture(scope="module")
def cases():
    fields = box_fields((12, 8, 8))
    notched = fields["random"].copy()
    notched[2:7, 3:, 3:] = 0.0
    fields["notched"] = notched
    return {name: (field, fine_frequencies(field, MODES)) for name, field in fields.items()}


def error(case, method, share=0.0):
    field, exact = case
    return rms_error(coarse_frequencies(field, method, MODES, lumped_share=share), exact)[0]


def direct(objective):
    return lambda young: fit(objective, young).moduli


@pytest.mark.parametrize("material", ["uniform", "smooth", "random", "notched"])
def test_default_objective_beats_averaging_and_galerkin(cases, material):
    share = lumped_share(DEFAULT_OBJECTIVE)
    found = error(cases[material], direct(DEFAULT_OBJECTIVE), share)
    assert found < error(cases[material], galerkin) < error(cases[material], average) * 1.001


@pytest.mark.parametrize(
    ("material", "allowed"),
    [("uniform", 0.002), ("smooth", 0.01), ("random", 0.02), ("notched", 0.03)],
)
def test_forests_stay_near_the_direct_fit(cases, model, material, allowed):
    """About twice the largest difference measured with these few training samples."""
    field, _ = cases[material]
    fitted = coarse_frequencies(field, direct(DEFAULT_OBJECTIVE), MODES)
    learned = coarse_frequencies(field, lambda young: coarsen(model, young), MODES)
    assert np.abs(learned / fitted - 1).max() < allowed


@pytest.mark.parametrize("poisson", [0.1, 0.33, 0.45])
@pytest.mark.parametrize(
    ("material", "allowed"), [("uniform", 0.04), ("smooth", 0.04), ("notched", 0.05)]
)
def test_one_fit_serves_all_ratios(cases, material, poisson, allowed):
    """Measured 0.7 to 2.9 %; a fit at the ratio 0.45 itself is 6 to 9 % too soft."""
    field, _ = cases[material]
    share = lumped_share(DEFAULT_OBJECTIVE)
    exact = fine_frequencies(field, MODES, poisson)
    found = coarse_frequencies(field, direct(DEFAULT_OBJECTIVE), MODES, poisson, share)
    assert rms_error(found, exact)[0] < allowed


def test_galerkin_bounds_the_frequencies_from_above(cases):
    """Galerkin coarsening with the consistent mass is a Ritz method on a subspace."""
    for field, exact in cases.values():
        assert (coarse_frequencies(field, galerkin, MODES) >= exact * (1 - 1e-8)).all()


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("material", "objective", "expected"),
    [
        ("uniform", "inertial", 0.044),
        ("uniform", "oversampled", 0.031),
        ("random", "inertial", 0.133),
        ("random", "oversampled", 0.022),
    ],
)
def test_errors_measured_on_the_larger_box(material, objective, expected):
    field = box_fields()[material]
    found = rms_error(coarse_frequencies(field, direct(objective)), fine_frequencies(field))[0]
    assert abs(found - expected) < 0.003
