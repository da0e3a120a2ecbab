"""What users would take elsewhere: tetrahedra meshed by Gmsh, assembled by scikit-fem, and SLEPc.

Both packages are optional, since nothing but this comparison needs them.
"""

import time
from collections.abc import Callable
from importlib import import_module, metadata
from typing import Any

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Index
from carillon.errors import one_line
from carillon.processes.mpi import MPI
from carillon.processes.slepc import SLEPc
from solver.assembly.system import distributed_matrix
from solver.linear.factorisation import factor_package
from studies.accuracy.solids import DENSITY, POISSON, YOUNG, ReferenceSolid
from studies.accuracy.spectra import Spectrum

PACKAGES = ("gmsh", "skfem")
INSTALLED_BY = ("gmsh", "scikit-fem")
REQUIREMENTS = "workflow/envs/requirements-tetrahedra.txt"
ORDERS = {"linear tetrahedra": 1, "quadratic tetrahedra": 2}
"""Degrees of the shape functions; those of the faces are the same."""

TOLERANCE = 1e-8
"""Relative residual of the eigenpairs."""
SHIFT = 1e-3
"""Shift of K by M, relative to a guess at the first elastic eigenvalue."""
SPARE = 8
"""Eigenpairs computed beyond those wanted, as copies of multiple ones may come late."""

GMSH_TETRAHEDRON = {1: 4, 2: 11}
"""Gmsh's number for the element by its degree."""
GMSH_EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [2, 3], [1, 3]])
"""Corners of the edges whose midpoints are Gmsh's nodes 4 to 9."""
SKFEM_EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
"""The same of scikit-fem."""


def missing() -> str:
    """One sentence if the packages cannot be used; empty if they can."""
    for package in PACKAGES:
        try:
            import_module(package)
        except (ImportError, OSError) as error:  # OSError: a library that Gmsh needs.
            reason = one_line(str(error))
            return (
                f"Without tetrahedra: {package} cannot be loaded ({reason}); "
                f"install it by pip install -r {REQUIREMENTS}."
            )
    return ""


def versions() -> dict[str, str]:
    """Versions of the packages by the names that they are installed by."""
    return {name: metadata.version(name) for name in INSTALLED_BY}


def tetrahedra(solid: ReferenceSolid, spacing: float, kind: str, modes: int) -> Spectrum:
    """Lowest eigenvalues by tetrahedra whose nodes are about `spacing` [m] apart."""
    begin = time.perf_counter()
    order = ORDERS[kind]
    points, elements = mesh(solid, order * spacing, order)
    meshed = time.perf_counter()
    K, M = matrices(points, elements)
    values = lowest(K, M, modes, max(solid.sides))
    solved = time.perf_counter()
    return Spectrum(values, spacing, K.shape[0], meshed - begin, solved - meshed)


def mesh(solid: ReferenceSolid, size: float, order: int) -> tuple[Array, Index]:
    """Points (n, 3) [m] and elements (m, 4 or 10) of a solid with edges of about `size` [m]."""

    def draw(gmsh: Any) -> None:
        x, y, z = solid.sides
        shapes = gmsh.model.occ
        if solid.shape == "box":
            body = shapes.addBox(-x / 2, -y / 2, -z / 2, x, y, z)
        else:
            if solid.shape == "ellipsoid":
                body = shapes.addSphere(0, 0, 0, 0.5)
            else:
                body = shapes.addCylinder(0, 0, -0.5, 0, 0, 1, 0.5)
            shapes.dilate([(3, body)], 0, 0, 0, x, y, z)

    return gmsh_elements(draw, size, order, GMSH_TETRAHEDRON[order])


def gmsh_elements(
    draw: Callable[[Any], None], size: float, order: int, kind: int, dimension: int = 3
) -> tuple[Array, Index]:
    """Points (n, 3) [m] and elements (m, k) that Gmsh makes of what `draw` describes.

    Parameters
    ----------
    draw
        Makes a model by the shapes ``gmsh.model.occ``; it may set options and fields of sizes.
    size
        Edges of the elements [m], if `draw` sets nothing else.
    order, kind
        Degree of the elements' sides, and Gmsh's number for the elements.
    """
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for limit in ("Min", "Max"):
            gmsh.option.setNumber(f"Mesh.MeshSize{limit}", size)
        draw(gmsh)
        gmsh.model.occ.synchronize()
        gmsh.model.mesh.generate(dimension)
        gmsh.model.mesh.setOrder(order)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        _, nodes = gmsh.model.mesh.getElementsByType(kind)
        corners = gmsh.model.mesh.getElementProperties(kind)[3]
    finally:
        gmsh.finalize()
    number = np.full(int(tags.max()) + 1, -1)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    elements = number[nodes.astype(np.int64)].reshape(-1, corners)
    used = np.unique(elements)
    place = np.full(len(tags), -1)
    place[used] = np.arange(len(used))
    return coordinates.reshape(-1, 3)[used], place[elements]


def matrices(points: Array, elements: Index) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """K [N/m] and consistent M [kg] of linear or quadratic tetrahedra with faces alike."""
    from skfem import Basis, BilinearForm, ElementTetP1, ElementTetP2, ElementVector, MeshTet
    from skfem.helpers import dot
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    corners = elements[:, :4]
    used, compact = np.unique(corners, return_inverse=True)
    straight = MeshTet(
        *map(np.ascontiguousarray, (points[used].T, compact.reshape(corners.shape).T))
    )
    if elements.shape[1] == 4:
        basis = Basis(straight, ElementVector(ElementTetP1()))
    else:
        basis = Basis(_curved(straight, points, elements), ElementVector(ElementTetP2()))

    @BilinearForm
    def mass(u: Any, v: Any, _: Any) -> Any:
        return DENSITY * dot(u, v)

    K = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)
    return K.tocsr(), mass.assemble(basis).tocsr()


def _curved(straight: Any, points: Array, elements: Index) -> Any:
    """The mesh whose edges have their midpoints where Gmsh has put them."""
    from dataclasses import replace

    from skfem import MeshTet2

    curved = MeshTet2.from_mesh(straight)
    places = curved.doflocs.copy()
    edge = np.full((4, 4), -1)
    for node, (a, b) in enumerate(GMSH_EDGES, start=4):
        edge[a, b] = edge[b, a] = node
    for local, (a, b) in enumerate(SKFEM_EDGES, start=4):
        places[:, curved.dofs.element_dofs[local]] = points[elements[:, edge[a, b]]].T
    return replace(curved, doflocs=places)


def lowest(K: sp.csr_matrix, M: sp.csr_matrix, modes: int, longest: float) -> Array:
    """Lowest eigenvalues by Krylov-Schur in shift-and-invert mode with a sparse Cholesky.

    `longest` is the longest side [m] of the solid.
    """
    # Of the slowest wave along it.
    guess = YOUNG / DENSITY / longest**2
    stiffness, weight = (distributed_matrix(matrix, MPI.COMM_SELF) for matrix in (K, M))
    solver = SLEPc.EPS().create(MPI.COMM_SELF)
    try:
        solver.setOperators(stiffness, weight)
        solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
        solver.setDimensions(modes + SPARE)
        solver.setTolerances(TOLERANCE)
        solver.setTarget(-SHIFT * guess)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
        solver.getST().setType(SLEPc.ST.Type.SINVERT)
        factor = solver.getST().getKSP().getPC()
        factor.setType("cholesky")
        factor.setFactorSolverType(factor_package(1))
        solver.solve()
        values = [solver.getEigenvalue(index).real for index in range(solver.getConverged())]
    finally:
        for used in (solver, stiffness, weight):
            used.destroy()
    return np.sort(values)[:modes]
