"""Eq. (8) as it is printed: forces are drawn, both meshes are solved, energies are compared.

Kept to check `energy`, to measure what its closed form saves, and to fit datasets as the paper did.
One block at a time: here the lanes are forces.
"""

from typing import NamedTuple

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import void_patterns
from carillon.fem.element import DEFAULT_POISSON
from carillon.numerics.simd import LANES, add_product, empty, load, spread, store, store_tile, zeros
from carillon.processes.threads import blas_threads
from dataset_gen.objectives.coarse_response import (
    Coarse,
    CoarseResponse,
    coarse_of,
    empty_response,
    respond,
    write_derivatives,
)
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.descent import (
    MAX_ITERATIONS,
    VALUE,
    begin,
    converged,
    judge,
    propose,
    start,
)
from dataset_gen.objectives.elimination import TILE, elimination_of
from dataset_gen.objectives.energy import MODULUS_CEILING
from dataset_gen.objectives.free_block import squares
from dataset_gen.objectives.kernel import (
    COLUMNS,
    MOTIONS,
    STRAINS,
    WEIGHTS,
    assemble,
    factorise,
    multiply,
    solve_lower,
    weigh,
)
from dataset_gen.objectives.patterns import pattern_of
from dataset_gen.objectives.quadratic import MODULUS_FLOOR, PatternFits, reference_moduli

DIRECTIONS = 1000
"""Force directions of one fit (section 8.1)."""
MAGNITUDES = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Five magnitudes in each direction; they only rescale the energies."""

FORCES = (0, 0, 0, 1)
"""First counter of the forces of a sample, words from the least on; moduli are drawn from zero."""


class Loaded(NamedTuple):
    """Forces on a block, `LANES` to a column."""

    felt: Array
    """(18, columns) what the coarse element feels of them, V^T f."""
    energies: Array
    """(columns) fine energies f^T K^+ f."""


class Room(NamedTuple):
    """Room for an evaluation: (9, columns) and (18, columns) numbers."""

    rows: Array
    bent: Array


@blas_threads(1)
def draw_forces(young: Array, directions: int, generator: np.random.Generator) -> Array:
    """Self-equilibrated unit forces (a, directions) on the active nodes of the block `young` (8,).

    Multiplied by independent chi-distributed lengths they would be Gaussian.
    """
    pattern = pattern_of(int(void_patterns(young)), DEFAULT_POISSON)
    gaussian = generator.standard_normal((len(pattern.dofs), directions))
    forces = pattern.without_null(gaussian)
    return np.asarray(forces / np.linalg.norm(forces, axis=0))


@compiled
def _load_block(
    coarse: Coarse, young: Array, unit: Array, magnitudes: Array, loaded: Loaded
) -> None:
    """Solve the block `young` (1, 8) for the unit forces (a, m, LANES) times all magnitudes."""
    factor, stiffness, _ = coarse.block
    size, columns = 3 * len(factor.diagonal), len(loaded.energies)
    directions = unit.shape[1]
    weights, tiles = empty(WEIGHTS), empty(TILE * (len(stiffness.start) - 1))
    x, felt = empty(size * COLUMNS), empty(MOTIONS * COLUMNS)
    weigh(young, 0, weights)
    assemble(stiffness, weights, tiles)
    factorise(factor, tiles)
    for panel in range(0, columns, COLUMNS):
        for dof in range(size):
            for column in range(COLUMNS):
                magnitude, direction = divmod(panel + column, directions)
                for lane in range(LANES):
                    force = magnitudes[magnitude] * unit[dof, direction, lane]
                    x[dof * COLUMNS + column, lane] = force
        multiply(felt, (coarse.basis, 0, 1, MOTIONS), (x, 0, 1, COLUMNS), MOTIONS, COLUMNS, size)
        solve_lower(factor, tiles, x, COLUMNS)
        for column in range(COLUMNS):
            energy = spread(0.0)
            for n in range(column, COLUMNS * size, COLUMNS):
                energy = energy + load(x, n) * load(x, n)
            store(loaded.energies, panel + column, energy)
            for i in range(MOTIONS):
                value = load(felt, i * COLUMNS + column)
                store(loaded.felt, i * columns + panel + column, value)


@compiled
def _sum_lanes(numbers: Array) -> None:
    """Put the sum of its lanes into all lanes of each number."""
    for n in range(len(numbers)):
        total = 0.0
        for lane in range(LANES):
            total += numbers[n, lane]
        store(numbers, n, spread(total))


@compiled
def _evaluate(
    coarse: Coarse, loaded: Loaded, response: CoarseResponse, room: Room, logs: Array, out: Array
) -> None:
    """Value, gradient and Hessian in log E of the sum over all forces of (coarse - fine energy)^2.

    The coarse energy f^T V B V^T f is the sum of its derivatives by -log E_q. These, and in the
    ninth row the energies' differences, are the `rows` (9, columns).
    """
    respond(coarse, logs, response)
    rows, bent = room
    columns = len(loaded.energies)
    strains, gram, slope = empty(STRAINS * COLUMNS), empty(81), empty(MOTIONS**2)
    for panel in range(0, columns, COLUMNS):
        felt = (loaded.felt, panel, 1, columns)
        multiply(strains, (response.strained, 0, 1, STRAINS), felt, STRAINS, COLUMNS, MOTIONS)
        for column in range(COLUMNS):
            energy = spread(0.0)
            at = panel + column
            for q in range(8):
                part = spread(0.0)
                for n in range(6 * q, 6 * q + 6):
                    strain = load(strains, n * COLUMNS + column)
                    part = part + strain * strain
                store(rows, q * columns + at, part)
                energy = energy + part
            difference = energy - load(loaded.energies, at)
            store(rows, 8 * columns + at, difference)
            for i in range(MOTIONS):
                n = i * columns + at
                store(bent, n, spread(2.0) * difference * load(loaded.felt, n))
    for i in range(0, 9, 3):
        for j in range(0, i + 3, 3):
            left, right = (rows, i * columns, columns, 1), (rows, j * columns, columns, 1)
            store_tile((gram, 9 * i + j, 9, 1), add_product(zeros(3, 3), left, right, columns))
    left, right = (bent, 0, columns, 1), (loaded.felt, 0, columns, 1)
    multiply(slope, left, right, MOTIONS, MOTIONS, columns)
    _sum_lanes(gram)
    _sum_lanes(slope)
    write_derivatives(response, gram, slope, out)


@compiled
def _fit(
    coarse: Coarse,
    young: Array,
    forces: tuple[Array, Array],
    origin: Array,
    bounds: tuple[float, float],
) -> tuple[Array, float, bool]:
    """Logarithms (8) of the moduli of the block `young` (1, 8), residual and convergence."""
    unit, magnitudes = forces
    columns = unit.shape[1] * len(magnitudes)
    loaded = Loaded(empty(MOTIONS * columns), empty(columns))
    room = Room(empty(9 * columns), empty(MOTIONS * columns))
    response, state = empty_response(), begin(*bounds)
    _load_block(coarse, young, unit, magnitudes, loaded)
    store(state.scale, 0, squares(loaded.energies, 0, columns))
    _sum_lanes(state.scale)
    for i in range(8):
        store(state.trial, i, spread(min(max(origin[i], bounds[0]), bounds[1])))
    _evaluate(coarse, loaded, response, room, state.trial, state.there)
    start(state)
    for _ in range(MAX_ITERATIONS):
        propose(state)
        _evaluate(coarse, loaded, response, room, state.trial, state.there)
        if judge(state):
            break
    residual = np.sqrt(state.here[VALUE, 0] / state.scale[0, 0])
    return state.x[:, 0].copy(), residual, converged(state, 0)


def fit_block(
    young: Array,
    generator: np.random.Generator,
    poisson: float = DEFAULT_POISSON,
    directions: int = DIRECTIONS,
    magnitudes: tuple[float, ...] = MAGNITUDES,
) -> PatternFits:
    """Fit of the block `young` (8,) from sampled forces: one row.

    Both meshes are solved for each direction at each magnitude, and the squared differences of all
    these energies are summed, as the paper says.
    """
    mask, largest = int(void_patterns(young)), young.max()
    scaled = (young / largest)[None]
    order = pattern_of(mask, poisson).positions(elimination_of(mask).dofs)
    forces = draw_forces(young, directions, generator)
    unit = np.zeros((len(forces), directions + -directions % (LANES * COLUMNS)))
    unit[:, :directions] = forces[order]
    logs, residual, settled = _fit(
        coarse_of(mask, poisson),
        scaled,
        (unit.reshape(len(unit), -1, LANES), np.array(magnitudes)),
        np.log(reference_moduli(scaled)[0]),
        (float(np.log(MODULUS_FLOOR)), float(np.log(MODULUS_CEILING))),
    )
    moduli = largest * np.exp(logs)
    return PatternFits(moduli[None], np.array([residual]), np.array([settled]))


def fit_sample(young: Array, seed: int, number: int, poisson: float) -> PatternFits:
    """Fit of the block `young` (8,), sample `number` of a dataset, by its own forces: one row."""
    key = np.array([seed, number], dtype=np.uint64)
    forces = np.random.Philox(key=key, counter=np.array(FORCES, dtype=np.uint64))
    return fit_block(young, np.random.Generator(forces), poisson)
