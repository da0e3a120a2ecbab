"""Vectors that a search for eigenvectors starts from, whatever the number of ranks."""

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import degrees_of_freedom
from solver.assembly.system import System


def start_vector(system: System, seed: int, search: int = 0) -> Array:
    """Vector (local unknowns,) to start a search from, its entries spread over [-1, 1).

    An entry depends on the seed, the search and the unknown's number in the mesh alone, so that the
    vector is the same on any number of ranks: SplitMix64 (Steele et al. 2014).
    """
    key = np.random.SeedSequence([seed, search]).generate_state(1, np.uint64)
    bits = degrees_of_freedom(system.nodes).astype(np.uint64) + np.uint64(1)
    bits = bits * np.uint64(0x9E3779B97F4A7C15) + key
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return (bits ^ (bits >> np.uint64(31))) / 2.0**63 - 1.0


def start_block(system: System, columns: int, seed: int) -> Array:
    """Block (local unknowns, columns) of such vectors."""
    block = np.empty((len(system.rigid), columns))
    for number in range(columns):
        block[:, number] = start_vector(system, seed, number)
    return block


def every_unknown(system: System) -> Array:
    """Block (local unknowns, n_dofs) whose columns move one unknown each: the whole space."""
    block = np.zeros((len(system.rigid), system.n_dofs))
    block[np.arange(len(block)), degrees_of_freedom(system.nodes)] = 1.0
    return block
