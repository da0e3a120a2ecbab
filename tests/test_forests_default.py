"""The forests that come with Carillon: what the package promises of them."""

import json

import numpy as np
import pytest

from carillon.fem.element import DEFAULT_POISSON
from dataset_gen.objectives import DEFAULT_OBJECTIVE, fit
from dataset_gen.sampling import moduli, samples
from forests import coarsen, load_model
from forests.default import default_path

SEED = 1000
"""Of no training."""


@pytest.fixture(scope="module")
def model():
    return load_model()


def test_they_are_small_and_trained_on_ten_million_rows_of_the_default_objective(model):
    assert default_path().stat().st_size < 20e6
    assert (model.objective, model.poisson) == (DEFAULT_OBJECTIVE, DEFAULT_POISSON)
    assert model.provenance["training_rows"] >= 10_000_000
    assert json.loads(model.provenance["parameters"])["depth"] == 20
    assert model.scores["depth"] <= 20 and model.forests.trees == 3


def test_they_are_for_the_ratios_of_most_materials(model):
    """From cork to rubber, up to where trilinear elements lock."""
    assert model.ratios == (0.0, 0.49)


@pytest.mark.parametrize("distribution", ["uniform", "log-uniform"])
def test_they_reproduce_the_fit_on_fresh_blocks(model, distribution):
    """Measured 0.9997 and 0.998 for solid blocks, 0.9996 and 0.998 for the others."""
    young = samples(SEED, 0, 8192, moduli(distribution))
    exact, found = fit(model.objective, young).moduli, coarsen(model, young)
    solid = (young > 0).all(axis=1)
    for rows, least in ((solid, 0.99), (~solid, 0.99)):
        error = np.log(found[rows] / exact[rows])
        relative = np.log(exact[rows] / young[rows].mean(axis=1, keepdims=True))
        assert 1.0 - (error**2).mean() / relative.var() > least


def test_blocks_of_one_material_are_met(model):
    young = 70e9 * (np.arange(1, 256)[:, None] >> np.arange(8) & 1)
    exact = fit(model.objective, young).moduli
    np.testing.assert_allclose(coarsen(model, young), exact, rtol=5e-5)


def test_far_outside_the_trained_range_they_are_as_good_as_inside(model):
    young = np.random.default_rng(SEED).uniform(0.01, 10.0, (4096, 8))
    inside, outside = coarsen(model, young), coarsen(model, 1e9 * young)
    # A feature may round across a threshold.
    assert (np.abs(outside / (1e9 * inside) - 1) > 1e-6).mean() < 1e-3
