"""Orthonormal combinations of vectors, from their Gram matrix."""

import numpy as np
import pytest

from solver.subspace.orthonormal import orthonormal


@pytest.mark.parametrize("rank", [0, 1, 4, 6])
def test_combinations_are_orthonormal_and_as_many_as_are_independent(rank, capfd):
    """Of no vectors at all, too, without a word: results are printed where LAPACK complains."""
    random = np.random.default_rng(rank)
    vectors = random.normal(size=(20, rank)) @ random.normal(size=(rank, 6 if rank else 0))
    coefficients, _ = orthonormal(vectors.T @ vectors)
    found = vectors @ coefficients
    assert found.shape == (20, rank)
    assert np.allclose(found.T @ found, np.eye(rank), atol=1e-9)
    assert capfd.readouterr() == ("", "")
