"""Spectra of coarse solids of wood beside those of their voxels (test support).

`python -m tests.anisotropic_spectra` prints the errors that docs/explanation/coarsening.md has.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import perf_counter

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import ALL_FILLED, coarse_cell_mass
from carillon.fem.element import (
    GAUSS_POINTS,
    elasticity_matrix,
    nodal_mass,
    shape_gradients,
    strain_displacement,
)
from carillon.fem.geometry import (
    Blocks,
    HexMesh,
    blocks_from_mesh,
    hexmesh_from_grid,
    hexmesh_from_voxels,
    load_surface,
    voxelize,
)
from carillon.processes.petsc import PETSc
from carillon.processes.slepc import SLEPc
from dataset_gen.objectives import lumped_share
from dataset_gen.objectives.anisotropic import GENERAL_OBJECTIVES, fit_blocks
from solver.coarsening.anisotropic import AnisotropicCoarsening

LAST = 60
"""Modes 7 to this one are compared."""


def orthotropic(
    young: tuple[float, ...], shear: tuple[float, ...], poisson: tuple[float, ...]
) -> Array:
    """Elasticity (6, 6) from E_x E_y E_z, G_xy G_yz G_zx and nu_xy nu_yz nu_xz."""
    compliance = np.diag([1.0 / each for each in (*young, *shear)])
    for (a, b), ratio in zip(((0, 1), (1, 2), (0, 2)), poisson):
        compliance[a, b] = compliance[b, a] = -ratio / young[a]
    return np.linalg.inv(compliance)


def spruce() -> Array:
    """Sitka spruce, grain along x, radius along y (Wood Handbook, FPL-GTR-282, chapter 5)."""
    along = 1.1 * 9.9e9
    radial, tangential = 0.078 * along, 0.043 * along
    shear = (0.064 * along, 0.003 * along, 0.061 * along)
    return orthotropic((along, radial, tangential), shear, (0.372, 0.435, 0.467))


def rotated(elasticity: Array, rotation: Array) -> Array:
    """Elasticity (6, 6) of a material turned by a rotation (3, 3), or mirrored."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    strain = np.zeros((6, 6))
    for i, (a, b) in enumerate(pairs):
        for j, (c, d) in enumerate(pairs):
            # Engineering strain i of the material from strain j of space.
            straight = rotation[c, a] * rotation[d, b]
            strain[i, j] = straight if j < 3 else 0.5 * (straight + rotation[d, a] * rotation[c, b])
            strain[i, j] *= 1.0 if i < 3 else 2.0
    return strain.T @ elasticity @ strain


def turn(axis: tuple[float, ...], degrees: float) -> Array:
    """Rotation (3, 3)."""
    from scipy.spatial.transform import Rotation

    unit = np.array(axis) / np.linalg.norm(axis)
    return np.asarray(Rotation.from_rotvec(np.radians(degrees) * unit).as_matrix())


def element_stiffness(edge: float, elasticity: Array) -> Array:
    """Stiffness (m, 24, 24) of elements with matrices (m, 8, 6, 6) at their points."""
    strain = strain_displacement(shape_gradients(GAUSS_POINTS))
    total = np.zeros((len(elasticity), 24, 24))
    for q in range(8):
        total += strain[q].T @ (elasticity[:, q] @ strain[q])
    return edge / 8.0 * total


def assembled(cells: Index, matrices: Array, nodes: int) -> sp.csr_matrix:
    """Sparse sum of element matrices (m, 8 c, 8 c), c unknowns a node."""
    width = matrices.shape[1] // 8
    dofs = (width * cells[:, :, None].astype(np.int64) + np.arange(width)).reshape(len(cells), -1)
    rows, columns = np.repeat(dofs, dofs.shape[1], axis=1), np.tile(dofs, dofs.shape[1])
    size = width * nodes
    return sp.csr_matrix((matrices.ravel(), (rows.ravel(), columns.ravel())), (size, size))


def frequencies(stiffness: sp.csr_matrix, nodal: sp.csr_matrix, count: int) -> Array:
    """Lowest `count` frequencies [Hz], rigid modes included, by SLEPc and MUMPS."""
    mass = sp.kron(nodal, sp.identity(3), format="csr")
    scale = stiffness.diagonal().sum() / mass.diagonal().sum()
    solver = SLEPc.EPS().create(comm=PETSc.COMM_SELF)
    a, b = (
        PETSc.Mat().createAIJ(m.shape, csr=(m.indptr, m.indices, m.data), comm=PETSc.COMM_SELF)
        for m in (stiffness / scale, mass)
    )
    for matrix in (a, b):
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    solver.setOperators(a, b)
    solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    solver.setDimensions(count, 2 * count + 20)
    solver.setTolerances(1e-9, 200)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    # Small beside the first eigenvalue, large beside rounding.
    solver.setTarget(-1e-7)
    transform = solver.getST()
    transform.setType(SLEPc.ST.Type.SINVERT)
    krylov = transform.getKSP()
    krylov.setType("preonly")
    krylov.getPC().setType("cholesky")
    krylov.getPC().setFactorSolverType("mumps")
    solver.solve()
    values = np.sort([solver.getEigenvalue(i).real for i in range(solver.getConverged())])
    for used in (solver, a, b):
        used.destroy()
    if len(values) < count:
        raise RuntimeError(f"{len(values)} modes converged of {count}")
    return np.asarray(np.sqrt(np.maximum(values[:count] * scale, 0.0)) / (2.0 * np.pi))


@dataclass(frozen=True)
class Solid:
    """Voxels with a law and a relative modulus each."""

    mesh: HexMesh
    laws: Array
    """(l, 6, 6) elasticity matrices [Pa]."""
    law: Index
    factor: Array
    """(m,) law of each voxel and a factor on it."""

    @property
    def elasticity(self) -> Array:
        """(m, 6, 6) elasticity matrix of each voxel."""
        return np.asarray(self.laws[self.law] * self.factor[:, None, None])


def fine_frequencies(solid: Solid, count: int = LAST, density: float = 400.0) -> Array:
    """Frequencies of the voxels."""
    mesh = solid.mesh
    stiffness = np.empty((mesh.n_cells, 24, 24))
    for law, matrix in enumerate(solid.laws):
        chosen = solid.law == law
        unit = element_stiffness(mesh.edge, np.tile(matrix, (1, 8, 1, 1)))
        stiffness[chosen] = solid.factor[chosen, None, None] * unit
    mass = density * mesh.edge**3 * np.tile(nodal_mass(), (mesh.n_cells, 1, 1))
    return frequencies(
        assembled(mesh.cells, stiffness, mesh.n_nodes),
        assembled(mesh.cells, mass, mesh.n_nodes),
        count,
    )


def block_elasticity(solid: Solid, blocks: Blocks) -> tuple[Array, Flags]:
    """Matrices (mc, 8, 6, 6) of the blocks' cells, zero where void, and which are filled."""
    filled = blocks.mask
    return np.where(filled[..., None, None], solid.elasticity[blocks.fine_of_block], 0.0), filled


def coarse_frequencies(
    blocks: Blocks,
    elasticity: Array,
    lumped: float = 0.0,
    count: int = LAST,
    density: float = 400.0,
) -> Array:
    """Frequencies of the coarse mesh with matrices (mc, 8, 6, 6) at the points."""
    coarse, fine_edge = blocks.coarse, blocks.fine.edge
    mass = np.einsum("ej,jab->eab", blocks.mask.astype(float), coarse_cell_mass())
    whole = blocks.pattern == ALL_FILLED
    mass[whole] = (1.0 - lumped) * mass[whole] + lumped * np.eye(8)
    return frequencies(
        assembled(coarse.cells, element_stiffness(coarse.edge, elasticity), coarse.n_nodes),
        assembled(coarse.cells, density * fine_edge**3 * mass, coarse.n_nodes),
        count,
    )


def galerkin(elasticity: Array, _: Flags) -> Array:
    """Matrices at the points whose element is the projection of the block."""
    near = 0.5 + np.sqrt(3.0) / 4.0
    line = np.array([[near, 1.0 - near], [1.0 - near, near]])
    weights = np.kron(np.kron(line, line), line)
    return np.einsum("qj,njab->nqab", weights, elasticity)


def average(elasticity: Array, _: Flags) -> Array:
    """The mean of all eight cells at every point."""
    return np.repeat(elasticity.mean(axis=1, keepdims=True), 8, axis=1)


def own_law(elasticity: Array, filled: Flags) -> Array:
    """The matrix of each octant's cell; where it is void, the mean of the filled cells."""
    mean = elasticity.sum(axis=1, keepdims=True) / filled.sum(axis=1)[:, None, None, None]
    return np.where(filled[..., None, None], elasticity, mean)


def fitted(elasticity: Array, filled: Flags, objective: str = "calibrated") -> Array:
    """Matrices at the points by an objective for general cells."""
    scales = fit_blocks(elasticity, filled, objective).scales
    return own_law(elasticity, filled) * scales[..., None, None]


METHODS: dict[str, tuple[Callable[[Array, Flags], Array], str]] = {
    "own law": (own_law, "energy"),
    "average": (average, "energy"),
    "galerkin": (galerkin, "energy"),
    "hybrid": (partial(fitted, objective="hybrid"), "hybrid"),
    "calibrated": (fitted, "calibrated"),
}
"""Matrices at the points, and the objective whose share of lumped mass goes with them."""


def errors(solid: Solid) -> dict[str, float]:
    """Root mean square of the relative errors of modes 7 to 60, by method."""
    fine = fine_frequencies(solid)
    blocks = blocks_from_mesh(solid.mesh)
    content = block_elasticity(solid, blocks)
    return {
        name: rms_error(coarse_frequencies(blocks, points(*content), lumped_share(mass)), fine)
        for name, (points, mass) in METHODS.items()
    }


def rms_error(coarse: Array, fine: Array) -> float:
    """Root mean square of the relative errors of modes 7 to the last."""
    return float(np.sqrt(np.mean((coarse[6:] / fine[6:] - 1.0) ** 2)))


def one_law(mesh: HexMesh, law: Array) -> Solid:
    """A solid of one matrix."""
    return Solid(mesh, law[None], np.zeros(mesh.n_cells, dtype=int), np.ones(mesh.n_cells))


def two_laws(mesh: HexMesh, other: Array, chosen: Flags | Array) -> Solid:
    """A solid of spruce, but for the voxels chosen."""
    return Solid(mesh, np.stack([spruce(), other]), chosen.astype(int), np.ones(mesh.n_cells))


def places(mesh: HexMesh, axis: int) -> Array:
    """Centres (m,) of the voxels along an axis, in voxels."""
    return np.asarray(mesh.nodes[mesh.cells][:, :, axis].mean(axis=1) / mesh.edge)


def bar(*shape: int) -> HexMesh:
    """A bar of voxels of a millimetre."""
    return hexmesh_from_grid(np.argwhere(np.ones(shape)), np.zeros(3), 1e-3)


def print_speeds(mesh: HexMesh) -> None:
    """Print blocks fitted a second on one core, and what a solid of one law takes.

    The blocks have three laws and moduli of their own.
    """
    generator = np.random.default_rng(0)
    laws = np.stack([spruce(), 1.3 * rotated(spruce(), turn((1, 2, 3), 50)), 1e10 * np.eye(6)])
    count = 8000
    mixed = laws[generator.integers(3, size=(count, 8))]
    mixed *= generator.uniform(0.1, 1.0, (count, 8, 1, 1))
    some = generator.random((count, 8)) < 0.6
    some[:, 0] = True
    for objective in GENERAL_OBJECTIVES:
        for name, filled in (("all filled", np.ones_like(some)), ("partly void", some)):
            cells = np.where(filled[..., None, None], mixed, 0.0)
            fit_blocks(cells[:500], filled[:500], objective)
            start = perf_counter()
            fit_blocks(cells, filled, objective)
            print(f"{objective}, {name}: {count / (perf_counter() - start):,.0f} blocks/s")
    mask = blocks_from_mesh(mesh).mask
    start = perf_counter()
    AnisotropicCoarsening().moduli(mask * 1e10, np.zeros(mask.shape, dtype=int), laws[:1] / 1e10)
    taken = perf_counter() - start
    patterns = len(np.unique(mask, axis=0))
    print(f"one law, {len(mask):,} blocks of {patterns} void patterns: {1e3 * taken:.1f} ms")


def main() -> None:
    """Print the errors of the coarse models of bars and of a solid of spruce."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--mesh", default="builtin:eared-head", help="surface of the solid")
    parser.add_argument("--resolution", type=int, default=24, help="voxels along its longest edge")
    parser.add_argument("--speed", action="store_true", help="only how fast blocks are fitted")
    arguments = parser.parse_args()
    solid = hexmesh_from_voxels(voxelize(load_surface(arguments.mesh), arguments.resolution))
    if arguments.speed:
        print_speeds(solid)
        return
    oblique = rotated(spruce(), turn((0, 0, 1), 20))
    slanted = rotated(spruce(), turn((1, 2, 3), 50))
    long, odd = bar(48, 12, 8), bar(47, 11, 7)
    crossed = rotated(spruce(), turn((0, 1, 0), 90))
    steel = 2e11 * elasticity_matrix(0.3)
    by_length, by_height = places(long, 0) > 25, places(long, 1) // 3 % 2
    cases = {
        "bar 48x12x8, grain along it": one_law(long, spruce()),
        "bar 48x12x8, grain 20 degrees off": one_law(long, oblique),
        "bar 47x11x7, grain along it": one_law(odd, spruce()),
        "bar 48x12x8, two woods glued": two_laws(long, 1.3 * slanted, by_length),
        "bar 48x12x8, layers crossed": two_laws(long, crossed, by_height),
        "bar 48x12x8, layers of spruce and steel": two_laws(long, steel, by_height),
        f"{arguments.mesh} at {arguments.resolution}, grain slanted": one_law(solid, slanted),
    }
    print(f"{'':45s}" + " ".join(f"{name:>10s}" for name in METHODS))
    for name, case in cases.items():
        row = " ".join(f"{100 * error:8.1f} %" for error in errors(case).values())
        print(f"{name[-44:]:45s}{row}", flush=True)


if __name__ == "__main__":
    main()
