"""Walls are all points as near to their surface as their thickness says, but beyond its rims."""

import igl
import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from carillon.fem.finite_cells.build import cell_grid, covering, finite_cells
from carillon.fem.finite_cells.inside import find_inside
from carillon.fem.finite_cells.lines import SKIPPED, points_on
from carillon.fem.geometry import builtin_surface
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.walls import SIDES, Wall
from tests.cut_solids import box, eigenvalues, turned, uniform
from tests.mesh_files import concatenated, inside_out, soup, with_turned

THICKNESS = 0.006


def rectangle(corner, one, other):
    """Two triangles of a rectangle, by a corner and two sides."""
    corner, one, other = map(np.array, (corner, one, other))
    corners = [corner, corner + one, corner + one + other, corner + other]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def tube(radius, length, sections):
    """A prism about z without its ends."""
    angles = 2.0 * np.pi * np.arange(sections) / sections
    ring = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ends = [np.column_stack([ring, np.full(sections, z)]) for z in (-0.5 * length, 0.5 * length)]
    low = np.arange(sections)
    next_low = (low + 1) % sections
    faces = [[low, next_low, next_low + sections], [low, next_low + sections, low + sections]]
    joined = np.concatenate([np.stack(each, axis=1) for each in faces])
    return trimesh.Trimesh(np.concatenate(ends), joined, process=False)


def without(surface, height):
    """The surface without the triangles whose middles are above a height."""
    kept = surface.triangles_center[:, 2] < height
    return trimesh.Trimesh(surface.vertices, surface.faces[kept], process=False)


def bumpy(sections=8):
    """A sheet of steep hills and saddles, by random heights."""
    steps = np.linspace(0.0, 0.2, sections)
    x, y = np.meshgrid(steps, steps, indexing="ij")
    heights = 0.01 * np.random.default_rng(1).normal(size=x.shape)
    number = np.arange(sections**2).reshape(sections, sections)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate(
        [np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))]
    )
    return trimesh.Trimesh(np.stack([x, y, heights], axis=-1).reshape(-1, 3), faces, process=False)


def moebius(sections=40):
    """A strip that is twisted once, on which no side is the outer one."""
    angles = 2.0 * np.pi * np.arange(sections) / sections
    points = [
        [
            (0.1 + w * np.cos(u / 2)) * np.cos(u),
            (0.1 + w * np.cos(u / 2)) * np.sin(u),
            w * np.sin(u / 2),
        ]
        for u in angles
        for w in (-0.02, 0.02)
    ]
    faces = []
    for i in range(sections):
        last = i == sections - 1
        p, q, u, v = 2 * i, 2 * i + 1, *((1, 0) if last else (2 * i + 2, 2 * i + 3))
        faces += [[p, q, v], [p, v, u]]
    return trimesh.Trimesh(points, faces, process=False)


def arrays(surface):
    return np.ascontiguousarray(surface.vertices), np.ascontiguousarray(surface.faces, np.int64)


def probes(wall, resolution, count):
    """Random points (p, 3) on the lattice's lines, most near a border, and which are inside."""
    grid = cell_grid(wall, resolution)
    inside, random = find_inside(wall, grid), np.random.default_rng(0)
    points, flags = [], []
    for pieces in inside.pieces:
        lines = np.flatnonzero(np.diff(pieces.start))
        line = random.choice(lines, count // 3)
        first, last = pieces.start[line], pieces.start[line + 1]
        near = random.choice(np.concatenate([pieces.low, pieces.high]), len(line))
        own = first + random.integers(0, 1 << 30, len(line)) % (last - first)
        ends = np.where(random.random(len(line)) < 0.5, pieces.low[own], pieces.high[own])
        place = np.where(random.random(len(line)) < 0.3, near, ends)
        place = place + random.normal(0.0, 0.1, len(line))
        within = [
            bool(((pieces.low[a:b] <= z) & (z <= pieces.high[a:b])).any())
            for a, b, z in zip(first, last, place)
        ]
        points.append(grid.origin + grid.edge * points_on(pieces, line, place))
        flags.append(np.array(within))
    return np.concatenate(points), np.concatenate(flags)


def beyond_rims(surface, points, nearest):
    """Which points (p, 3) lie beyond a rim of the surface that the `nearest` point is on."""
    vertices, faces = arrays(surface)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    _, edge, counts = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    found = np.zeros(len(points), dtype=bool)
    for half in np.flatnonzero(counts[edge.ravel()] == 1):
        face, side = divmod(half, 3)
        a, b = vertices[faces[face, side]], vertices[faces[face, (side + 1) % 3]]
        along = (b - a) / np.linalg.norm(b - a)
        inward = np.cross(surface.face_normals[face], along)
        place = a + np.clip((nearest - a) @ along, 0.0, np.linalg.norm(b - a))[:, None] * along
        on_it = np.linalg.norm(nearest - place, axis=1) < 1e-9
        found |= on_it & ((points - nearest) @ inward < -1e-10)
    return found


@pytest.mark.parametrize("name", ["bell", "pitcher", "box"])
def test_a_wall_about_a_closed_surface_is_all_that_is_near_it(name):
    surface = builtin_surface(name)
    points, inside = probes(Wall.of_surface(surface, THICKNESS), 16, 7_000)
    distance = np.sqrt(igl.point_mesh_squared_distance(points, *arrays(surface))[0])
    clear = np.abs(distance - 0.5 * THICKNESS) > 1e-9
    assert (inside == (distance <= 0.5 * THICKNESS))[clear].all()
    assert 0.2 < inside.mean() < 0.8


@pytest.mark.parametrize("side", ["inside", "outside"])
def test_a_wall_on_one_side_of_a_closed_surface_is_all_that_is_near_it_there(side):
    surface = turned(builtin_surface("bowl"))
    points, inside = probes(Wall.of_surface(surface, 0.003, side), 16, 6_000)
    distance = np.sqrt(igl.point_mesh_squared_distance(points, *arrays(surface))[0])
    enclosed = np.abs(igl.winding_number(*arrays(surface), points)) > 0.5
    wanted = (distance <= 0.003) & (enclosed == (side == "inside"))
    clear = (np.abs(distance - 0.003) > 1e-9) & (distance > 1e-9)
    assert (inside == wanted)[clear].all()


@pytest.mark.parametrize(
    "surface",
    [
        tube(0.05, 0.12, 24),
        without(box(0.2, 0.15, 0.1), 0.04),
        without(trimesh.creation.icosphere(2, 0.1), 0.03),
    ],
    ids=["tube", "tray", "bowl"],
)
def test_a_wall_about_an_open_surface_ends_with_it(surface):
    surface = turned(surface)
    points, inside = probes(Wall.of_surface(surface, THICKNESS), 16, 6_000)
    squares, _, nearest = igl.point_mesh_squared_distance(points, *arrays(surface))
    beyond = beyond_rims(surface, points, nearest)
    clear = np.abs(np.sqrt(squares) - 0.5 * THICKNESS) > 1e-9
    assert (inside == (np.sqrt(squares) <= 0.5 * THICKNESS) & ~beyond)[clear].all()
    assert beyond.any()


def test_hills_and_saddles_leave_no_gaps():
    wall = Wall.of_surface(bumpy(), THICKNESS)
    points, inside = probes(wall, 24, 9_000)
    squares, _, nearest = igl.point_mesh_squared_distance(points, *arrays(wall.surface))
    near = np.sqrt(squares) < 0.5 * THICKNESS - 1e-9
    assert inside[near & ~beyond_rims(wall.surface, points, nearest)].all()
    assert not inside[np.sqrt(squares) > 0.5 * THICKNESS + 1e-9].any()


@pytest.mark.parametrize("side", SIDES)
def test_volume_of_the_wall_of_a_sphere(side):
    surface = trimesh.creation.icosphere(3, 0.1)
    low, high = {"about": (-0.5, 0.5), "inside": (-1.0, 0.0), "outside": (0.0, 1.0)}[side]
    mean = (surface.volume * 3.0 / 4.0 / np.pi) ** (1.0 / 3.0)
    wanted = 4.0 / 3.0 * np.pi * np.diff((mean + 0.01 * np.array([low, high])) ** 3)[0]
    wall = Wall.of_surface(surface, 0.01, side)
    assert finite_cells(wall, 14).volume == pytest.approx(wanted, rel=2e-3)
    assert np.ptp(wall.bounds, axis=0) == pytest.approx([0.2 + 0.02 * high] * 3, rel=1e-12)
    inverted = Wall.of_surface(inside_out(surface), 0.01, side)
    assert finite_cells(inverted, 14).volume == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("side", SIDES)
def test_a_rectangle_with_a_wall_is_a_plate(side):
    sheet = turned(rectangle((0, 0, 0), (0.2, 0, 0), (0, 0.12, 0)))
    shift = {"about": 0.0, "inside": -0.002, "outside": 0.002}[side]
    plate = turned(box(0.2, 0.12, 0.004, at=(0.1, 0.06, shift)))
    wall = Wall.of_surface(sheet, 0.004, side)
    assert np.allclose(wall.bounds, plate.bounds, atol=1e-12)
    one, other = finite_cells(wall, 12), finite_cells(plate, 12)
    assert one.volume == pytest.approx(other.volume, rel=1e-12)
    found, wanted = (eigenvalues(uniform(each), 12)[6:] for each in (one, other))
    assert found == pytest.approx(wanted, rel=1e-7)


def test_a_tube_rings_as_one_whose_walls_are_drawn():
    sections, radius, half = 48, 0.05, 0.002
    one = finite_cells(Wall.of_surface(turned(tube(radius, 0.12, sections)), 2.0 * half), 14)
    # Of the drawn one corners lie so far out that its faces are half a wall from the middle.
    out = half / np.cos(np.pi / sections)
    drawn = trimesh.creation.annulus(radius - out, radius + out, 0.12, sections=sections)
    other = finite_cells(turned(drawn), 14)
    assert one.volume == pytest.approx(other.volume, rel=1e-3)
    found, wanted = (eigenvalues(uniform(each), 14)[6:] for each in (one, other))
    # A few cells along the tube: frequencies to a thousandth.
    assert np.sqrt(found) == pytest.approx(np.sqrt(wanted), rel=1e-3)


FLOOR, SIDE = (
    rectangle((0, 0, 0), (0.1, 0, 0), (0, 0.08, 0)),
    rectangle((0, 0, 0), (0, 0, 0.06), (0, 0.08, 0)),
)
FINER = trimesh.Trimesh(
    [[0, 0, 0], [0, 0.03, 0], [0, 0.08, 0], [0, 0, 0.06], [0, 0.08, 0.06]],
    [[0, 1, 3], [1, 4, 3], [1, 2, 4]],
    process=False,
)
STANDING = SIDE.copy().apply_translation((0.04, 0.0, 0.0))
HALVES = [rectangle((x, 0, 0), (side, 0, 0), (0, 0.08, 0)) for x, side in ((0, 0.04), (0.04, 0.06))]
CORNER = THICKNESS * (0.16 - (1.0 - np.pi / 4.0) * THICKNESS / 4.0)
TEE = THICKNESS * (0.16 - THICKNESS / 2.0)


@pytest.mark.parametrize(
    ("parts", "section"),
    [
        ([FLOOR, SIDE], CORNER),
        ([FLOOR, FINER], CORNER),
        ([*HALVES, STANDING], TEE),
        ([FLOOR, STANDING], TEE),
    ],
    ids=["L", "L of other corners", "T", "T of other corners"],
)
def test_walls_that_meet_are_joined(parts, section):
    wall = Wall.of_surface(turned(concatenated(*parts)), THICKNESS)
    # Outer corners are round.
    assert finite_cells(wall, 16).volume == pytest.approx(0.08 * section, rel=1e-3)
    # Skins have sharp corners, and where triangles share no corners each wall has its own.
    if parts != [FLOOR, STANDING]:
        assert wall.skin.volume == pytest.approx(0.08 * section, rel=3e-3)


def test_triangles_may_be_turned_and_repeated_as_files_have_them():
    plain = Wall.of_surface(bumpy(), THICKNESS)
    wanted = finite_cells(plain, 12).volume
    surface = soup(with_turned(plain.surface, 3, 10, 40))
    repeated = concatenated(surface, inside_out(surface))
    for each in (surface, repeated):
        assert finite_cells(Wall.of_surface(each, THICKNESS), 12).volume == pytest.approx(wanted)


def test_a_strip_without_sides_has_a_wall_about_it():
    strip = moebius()
    wall = Wall.of_surface(strip, 0.004)
    assert finite_cells(wall, 20).volume == pytest.approx(0.004 * strip.area, rel=0.01)
    assert wall.skin.is_watertight and wall.skin.is_winding_consistent
    with pytest.raises(UserError, match="turned both ways, so that its inside is not told apart"):
        Wall.of_surface(strip, 0.004, "inside")


def test_requested_voxels_are_those_of_the_whole_lattice():
    wall = Wall.of_surface(turned(tube(0.05, 0.12, 24)), THICKNESS)
    grid = cell_grid(wall, 16)
    requested = np.zeros(grid.shape, dtype=bool)
    requested[2:6, 4:9, 3:5] = True
    whole, some = find_inside(wall, grid), find_inside(wall, grid, requested)
    assert (some.state[~requested] == SKIPPED).all()
    for name in ("state", "crossed"):
        assert np.array_equal(getattr(some, name)[requested], getattr(whole, name)[requested])
    x, y = (each.pieces[0] for each in (some, whole))
    first = np.flatnonzero(np.diff(x.start))
    assert len(first) and np.array_equal(np.diff(x.start)[first], np.diff(y.start)[first])
    inner = Grid(grid.origin + 2 * grid.edge, grid.edge / 2, (8, 8, 8))
    assert find_inside(wall, inner).pieces[0].low.min() < 0.0


def test_cells_of_a_wall_can_be_divided():
    cover = covering(Wall.of_surface(turned(tube(0.05, 0.12, 24)), THICKNESS), 12)
    cells = cover.cells
    divided = cover.divided([cells.corner[:6] // cells.span[:6, None]])
    assert len(divided) > len(cover.cells)
    assert divided.volume == pytest.approx(cover.cells.volume, rel=1e-3)


@pytest.mark.parametrize("side", SIDES)
def test_the_skin_is_about_the_wall_and_keeps_vertices(side):
    surface = turned(builtin_surface("bowl"))
    wall = Wall.of_surface(surface, 0.003, side)
    assert wall.skin.volume == pytest.approx(finite_cells(wall, 20).volume, rel=0.01)
    outer = wall.skin.vertices[: len(surface.vertices)]
    moved = np.linalg.norm(outer - surface.vertices, axis=1)
    high = {"about": 0.5, "inside": 0.0, "outside": 1.0}[side] * 0.003
    assert np.median(moved) == pytest.approx(high, rel=0.01, abs=1e-12)


def test_a_wall_that_leaves_no_hollow_is_told(caplog):
    ball = trimesh.creation.icosphere(2, 0.1)
    cells = finite_cells(Wall.of_surface(ball, 0.11, "inside"), 8, name="a filled ball")
    assert cells.volume == pytest.approx(finite_cells(ball, 8).volume, rel=1e-6)
    assert "'a filled ball': a wall of 11 cm leaves no hollow" in caplog.text
    caplog.clear()
    finite_cells(Wall.of_surface(ball, 0.05, "inside"), 8, name="a hollow ball")
    assert not caplog.text


BALL = trimesh.creation.icosphere(1, 0.1)
TWO = concatenated(BALL, BALL.copy().apply_translation((0.3, 0.0, 0.0)))
NEEDLE = trimesh.Trimesh([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]], process=False)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Wall.of_surface(BALL, 0.0), "found a wall of 0 m, expected a thickness above 0"),
        (lambda: Wall.of_surface(BALL, float("nan")), "found a wall of nan m"),
        (lambda: Wall.of_surface(BALL, 0.3), "longest side is 20 cm, expected less"),
        (lambda: Wall.of_surface(BALL, 0.01, "left"), "expected one of about, inside, outside"),
        (
            lambda: Wall.of_surface(
                trimesh.Trimesh([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]]), 0.1
            ),
            "has no triangle with an area",
        ),
        (
            lambda: finite_cells(Wall.of_surface(BALL, 5e-5), 12),
            "expected at least 0.01 of the lattice spacing of 1.67 cm; raise the resolution to 41",
        ),
        (
            lambda: finite_cells(
                Wall.of_surface(
                    concatenated(BALL, BALL.copy().apply_translation((0.3, 0, 0))), 0.02
                ),
                10,
            ),
            "is in 2 pieces",
        ),
    ],
)
def test_walls_that_cannot_be_are_refused(make, sentence):
    with pytest.raises(UserError, match=sentence):
        make()
