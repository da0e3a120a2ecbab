"""Surfaces, voxel filling, hexahedra, blocks and pictures."""

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from carillon.drawing.solid import draw, guess_up
from carillon.errors import UserError
from carillon.fem.geometry import (
    BUILTINS,
    CORNER_OFFSETS,
    blocks_from_mesh,
    hexmesh_from_grid,
    hexmesh_from_voxels,
    load_surface,
    prolongation,
    surface_name,
    voxelize,
)
from carillon.fem.geometry.blocks import parts_of_patterns
from carillon.fem.geometry.faces import face_neighbours, surface_quads
from carillon.fem.geometry.topology import is_simple, thin_to

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {z}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def one_sentence(error: pytest.ExceptionInfo) -> str:
    text = str(error.value)
    assert "\n" not in text
    assert "Traceback" not in text
    return text


def euler_characteristic(filled: np.ndarray) -> int:
    """Pieces - tunnels + cavities of the open union of cubes (face-connected solid)."""
    padded = np.pad(filled, 1)
    count = int(padded.sum())
    for axes in ((0,), (1,), (2,), (0, 1), (0, 2), (1, 2), (0, 1, 2)):
        both = padded
        for axis in axes:
            both = both & np.roll(both, 1, axis=axis)
        count += (-1) ** len(axes) * int(both.sum())
    return count


def random_mesh(seed: int = 3):
    filled = np.random.default_rng(seed).random((6, 8, 4)) < 0.6
    return hexmesh_from_grid(np.argwhere(filled), np.array([0.3, -1.0, 2.0]), 0.25), filled


# Surfaces


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [
        ("absent.obj", None, "no such file"),
        ("notes.txt", "hello", "format '.txt' is not read"),
        ("noending", "hello", "is not read"),
        ("damaged.ply", "ply\nthis is no header", "could not be read"),
        ("damaged.glb", "x" * 40, "could not be read"),
        ("empty.obj", "", "has no faces"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 1\n", "has no faces"),
        ("flat.obj", TETRAHEDRON.format(z=0), "is flat"),
        ("nan.obj", TETRAHEDRON.format(z="nan"), "not finite"),
    ],
)
def test_unusable_mesh_file_is_one_sentence(tmp_path, file, text, expected):
    path = tmp_path / file
    if text is not None:
        path.write_text(text)
    with pytest.raises(UserError) as error:
        load_surface(str(path))
    sentence = one_sentence(error)
    assert sentence.startswith(str(path))
    assert expected in sentence


def test_unknown_builtin_lists_the_names():
    with pytest.raises(UserError) as error:
        load_surface("builtin:gong")
    assert all(name in one_sentence(error) for name in BUILTINS)


def test_unit_scales_the_coordinates(tmp_path):
    path = tmp_path / "tetrahedron.obj"
    path.write_text(TETRAHEDRON.format(z=2))
    np.testing.assert_allclose(load_surface(str(path), unit=1e-3).extents, [1e-3, 1e-3, 2e-3])


def test_objects_of_a_scene_are_concatenated(tmp_path):
    scene = trimesh.Scene([trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=1)])
    scene.export(tmp_path / "scene.glb")
    assert len(load_surface(str(tmp_path / "scene.glb")).faces) == 12 + 80


def test_surface_name_is_short():
    assert surface_name("builtin:bell") == "bell"
    assert surface_name("models/stanford-bunny.obj") == "stanford-bunny"


# Built-in objects


@pytest.mark.parametrize("name", BUILTINS)
def test_builtin_is_closed_and_faces_outwards(name):
    surface = load_surface(f"builtin:{name}")
    assert surface.is_watertight
    assert surface.is_winding_consistent
    assert all(shell.volume > 0 for shell in surface.split())
    assert 0.1 < surface.extents.max() < 0.5


@pytest.mark.parametrize("resolution", [24, 32, 40])
@pytest.mark.parametrize("name", BUILTINS)
def test_builtin_is_one_piece(name, resolution):
    voxels = voxelize(load_surface(f"builtin:{name}"), resolution, name=name)
    assert voxels.piece_sizes.tolist() == [voxels.n_cells]
    assert all(size % 2 == 0 for size in voxels.shape)
    assert max(voxels.shape) == resolution


@pytest.mark.parametrize("name", ["bar", "bowl"])
def test_volume_converges_to_that_of_the_surface(name):
    surface = load_surface(f"builtin:{name}")
    errors = [abs(voxelize(surface, r).volume / surface.volume - 1) for r in (12, 24, 64)]
    # Half a voxel on either side of a wall is the most that each resolution can be off; over a
    # curved or slanted surface most of it cancels.
    assert errors[-1] < 0.01
    assert errors[-1] < min(errors[:-1])


# Voxels


def test_box_of_whole_voxels_is_exact():
    box = trimesh.creation.box(extents=(0.8, 0.5, 0.3))
    box.apply_translation((1.0, 2.0, 3.0))
    voxels = voxelize(box, 8)
    assert voxels.shape == (8, 6, 4)
    assert voxels.filled[:, :5, :3].all()
    assert voxels.n_cells == 8 * 5 * 3
    np.testing.assert_allclose(voxels.origin, [0.6, 1.75, 2.85])
    assert voxels.edge == pytest.approx(0.1)


def test_voxels_do_not_depend_on_the_unit():
    surface = load_surface("builtin:bowl")
    scaled = load_surface("builtin:bowl", unit=1000.0)
    np.testing.assert_array_equal(voxelize(surface, 20).filled, voxelize(scaled, 20).filled)


def test_a_surface_with_a_hole_is_filled():
    sphere = trimesh.creation.icosphere(subdivisions=3)
    closed = voxelize(sphere, 16)
    sphere.update_faces(sphere.triangles_center[:, 2] < 0.9)
    assert voxelize(sphere, 16).n_cells == pytest.approx(closed.n_cells, rel=0.03)


def test_a_ring_as_thin_as_a_voxel_stays_a_ring():
    ring = trimesh.creation.torus(major_radius=1.0, minor_radius=0.12)
    voxels = voxelize(ring, 10)
    assert len(voxels.piece_sizes) == 1
    assert euler_characteristic(voxels.filled) == 0
    with pytest.raises(UserError, match="falls into"):
        voxelize(ring, 10, fill="centre")


@pytest.fixture
def two_boxes() -> trimesh.Trimesh:
    left, right = trimesh.creation.box(), trimesh.creation.box(extents=(0.5, 0.5, 0.5))
    return trimesh.util.concatenate([left, right.apply_translation((2.0, 0.0, 0.0))])


def test_pieces_are_an_error_that_counts_them(two_boxes):
    with pytest.raises(UserError) as error:
        voxelize(two_boxes, 22, name="boxes")
    sentence = one_sentence(error)
    assert sentence.startswith(
        "mesh 'boxes' at resolution 22 falls into 2 pieces (512 and 64 voxels)"
    )
    assert "--components largest" in sentence


def test_largest_piece_is_kept_on_request(two_boxes):
    assert voxelize(two_boxes, 22, components="largest").piece_sizes.tolist() == [512]


def test_cubes_that_share_an_edge_are_two_pieces():
    upper = trimesh.creation.box().apply_translation((1.0, 1.0, 0.0))
    touching = trimesh.util.concatenate([trimesh.creation.box(), upper])
    with pytest.raises(UserError, match="falls into 2 pieces"):
        voxelize(touching, 8, fill="centre")


@pytest.mark.parametrize("resolution", [1, 0, -4, 8.0, 2.5, "8", None, True])
def test_resolution_must_be_a_whole_number(resolution):
    with pytest.raises(UserError, match="at least 2 voxels") as error:
        voxelize(trimesh.creation.box(), resolution)
    one_sentence(error)


def test_resolution_beyond_memory_names_one_that_fits():
    with pytest.raises(UserError, match="about 25[0-9] or less") as error:
        voxelize(trimesh.creation.box(), 5000, name="box")
    one_sentence(error)


@pytest.mark.parametrize("option", [{"fill": "magic"}, {"components": "some"}])
def test_unknown_option_lists_the_known_ones(option):
    with pytest.raises(UserError, match="expected one of"):
        voxelize(trimesh.creation.box(), 8, **option)


@pytest.mark.parametrize("thickness", [0.005, 0.05])
def test_walls_thinner_than_the_voxels_are_an_error(thickness):
    sheet = trimesh.creation.box(extents=(1.0, 0.9, thickness))
    stand = trimesh.creation.box(extents=(0.02, 0.02, 0.5)).apply_translation((0, 0, 0.25))
    with pytest.raises(UserError, match="at resolution 8 fills no voxel") as error:
        voxelize(trimesh.util.concatenate([sheet, stand]), 8)
    one_sentence(error)


@pytest.mark.parametrize(
    ("file", "resolution", "volume"), [("stanford-bunny", 32, 7.60e-4), ("teapot", 40, 26.0)]
)
def test_open_scan_is_filled_in_one_piece(meshes, file, resolution, volume):
    voxels = voxelize(load_surface(str(meshes / f"{file}.obj")), resolution, name=file)
    assert len(voxels.piece_sizes) == 1
    assert voxels.volume == pytest.approx(volume, rel=0.02)


def test_orthographic_fill_reproduces_the_measured_bunny(meshes):
    surface = load_surface(str(meshes / "stanford-bunny.obj"))
    mesh = hexmesh_from_voxels(voxelize(surface, 32, fill="orthographic"))
    assert mesh.n_dofs == 31_026
    assert blocks_from_mesh(mesh).coarse.n_dofs == 5_733


def test_a_coarse_teapot_keeps_its_handle(meshes):
    surface = load_surface(str(meshes / "teapot.obj"))
    for resolution in (20, 24, 32):
        solid = ndimage.binary_fill_holes(voxelize(surface, resolution).filled)
        assert euler_characteristic(solid) <= 0


def test_loose_triangles_are_no_pieces():
    crumb = trimesh.Trimesh([[2, 0, 0], [2.1, 0, 0], [2, 0.1, 0]], [[0, 1, 2]], process=False)
    littered = trimesh.util.concatenate([trimesh.creation.box(), crumb])
    assert voxelize(littered, 26).piece_sizes.tolist() == [1000]


# Topology


def test_simple_voxels_are_those_whose_removal_keeps_the_euler_characteristic():
    rng = np.random.default_rng(0)
    found = {True: 0, False: 0}
    for _ in range(400):
        cube = rng.random((3, 3, 3)) < 0.5
        cube[1, 1, 1] = True
        without = cube.copy()
        without[1, 1, 1] = False
        simple = is_simple(sum(1 << int(bit) for bit in np.flatnonzero(cube)))
        found[simple] += 1
        if simple:
            assert euler_characteristic(cube) == euler_characteristic(without)
    assert min(found.values()) > 10


def test_thinning_keeps_pieces_and_tunnels():
    rng = np.random.default_rng(1)
    cover = ndimage.binary_dilation(rng.random((14, 12, 10)) < 0.02, iterations=2)
    thin = thin_to(cover, np.zeros_like(cover), rng.random(cover.shape))
    assert 0 < thin.sum() < 0.5 * cover.sum()
    assert ndimage.label(thin)[1] == ndimage.label(cover)[1]
    assert euler_characteristic(thin) == euler_characteristic(cover)


# Hexahedra and blocks


def test_local_corners_run_x_fastest():
    mesh, _ = random_mesh()
    offsets = mesh.node_grid[mesh.cells] - mesh.grid[:, None, :]
    np.testing.assert_array_equal(offsets, np.broadcast_to(CORNER_OFFSETS, offsets.shape))
    assert CORNER_OFFSETS[6].tolist() == [0, 1, 1]


def test_nodes_are_unique_ordered_and_used():
    mesh, filled = random_mesh()
    assert mesh.n_cells == filled.sum()
    assert (np.diff(mesh.node_grid @ np.array([1, 100, 10_000])) > 0).all()
    assert np.array_equal(np.unique(mesh.cells), np.arange(mesh.n_nodes))
    assert mesh.cells.dtype == mesh.node_grid.dtype == mesh.grid.dtype == np.int32
    np.testing.assert_allclose(mesh.nodes, mesh.origin + 0.25 * mesh.node_grid)


def test_every_cell_has_its_place_in_a_block():
    mesh, _ = random_mesh()
    blocks = blocks_from_mesh(mesh)
    block, position = np.nonzero(blocks.mask)
    cells = blocks.fine_of_block[block, position]
    assert np.array_equal(np.sort(cells), np.arange(mesh.n_cells))
    np.testing.assert_array_equal(
        mesh.grid[cells], 2 * blocks.coarse.grid[block] + CORNER_OFFSETS[position]
    )
    assert blocks.mask.any(axis=1).all()
    assert blocks.coarse.edge == 2 * mesh.edge


def mesh_of(*cells):
    return hexmesh_from_grid(np.array(cells), np.zeros(3), 0.5)


def test_parts_of_a_block_are_numbered():
    parts = parts_of_patterns()
    assert parts.shape == (256, 8)
    assert parts[0b10000001, [0, 7]].tolist() == [0, 1]
    assert parts[0b01101001, [0, 3, 5, 6]].tolist() == [0, 1, 2, 3]
    assert (parts[0b11111111] == 0).all() and (parts[0b00001111] == 0).all()


def test_parts_that_touch_nowhere_share_no_node():
    """Two rows of cells that end in opposite corners of one block."""
    rows = [(x, 0, 0) for x in (0, 1, 2)] + [(x, 1, 1) for x in (3, 4, 5)]
    blocks = blocks_from_mesh(mesh_of(*rows))
    assert blocks.coarse.grid[:, 0].tolist() == [0, 1, 1, 2]
    first, second = blocks.coarse.cells[:2].ravel(), blocks.coarse.cells[2:].ravel()
    assert len(np.intersect1d(first, second)) == 0
    assert blocks.contacts.tolist() == [2, 1, 2, 1]


def test_parts_that_meet_elsewhere_share_the_nodes_there():
    """The same columns on a plate: each has the plate's nodes, and above it its own."""
    columns = [(0, 0, z) for z in (2, 3)] + [(1, 1, z) for z in (2, 3)]
    plate = [(x, y, z) for x in range(2) for y in range(2) for z in range(2)]
    foot, first, second = blocks_from_mesh(mesh_of(*plate, *columns)).coarse.cells
    assert np.array_equal(first[:4], foot[4:]) and np.array_equal(second[:4], foot[4:])
    assert len(np.intersect1d(first[4:], second[4:])) == 0


def test_a_gap_between_blocks_stays_open():
    """Two walls, a void layer apart, in neighbouring blocks, joined at one end only."""
    walls = [(x, y, z) for x in (0, 3) for y in range(4) for z in range(6)]
    bridge = [(x, y, z) for x in (1, 2) for y in range(4) for z in (0, 1)]
    coarse = blocks_from_mesh(mesh_of(*walls, *bridge)).coarse
    left = coarse.cells[(coarse.grid[:, 0] == 0) & (coarse.grid[:, 2] == 2)]
    right = coarse.cells[(coarse.grid[:, 0] == 1) & (coarse.grid[:, 2] == 2)]
    assert len(left) and len(right) and len(np.intersect1d(left, right)) == 0
    in_a_wall, across = 3 + 4, 2
    assert len(face_neighbours(coarse)) == 2 * in_a_wall + across


def test_blocks_hinge_where_their_cells_do():
    """Cells of two blocks that share an edge share the coarse nodes of that edge."""
    coarse = blocks_from_mesh(mesh_of(*[(1, 1, 0), (2, 2, 0), (1, 1, 1), (2, 2, 1)])).coarse
    assert coarse.n_cells == 2
    assert coarse.node_grid[np.intersect1d(*coarse.cells)].tolist() == [[1, 1, 0], [1, 1, 1]]


def test_blocks_without_parts_are_an_ordinary_mesh():
    mesh = ball()
    coarse = blocks_from_mesh(mesh).coarse
    plain = hexmesh_from_grid(np.unique(mesh.grid >> 1, axis=0), mesh.origin, 2 * mesh.edge)
    for name in ("cells", "grid", "node_grid"):
        np.testing.assert_array_equal(getattr(coarse, name), getattr(plain, name))


def ball():
    """A ball: no block falls apart."""
    lattice = np.stack(np.meshgrid(*[np.arange(9) - 4.0] * 3, indexing="ij"), axis=-1)
    return hexmesh_from_grid(np.argwhere((lattice**2).sum(axis=-1) < 18.0), np.zeros(3), 0.5)


def test_prolongation_reproduces_linear_fields():
    mesh, _ = random_mesh()
    blocks = blocks_from_mesh(mesh)
    coarse, interpolate = blocks.coarse, prolongation(blocks)
    np.testing.assert_allclose(interpolate.sum(axis=1), 1.0)
    np.testing.assert_allclose(interpolate @ coarse.nodes, mesh.nodes, atol=1e-14)


def test_prolongation_reproduces_trilinear_fields():
    mesh = hexmesh_from_grid(np.argwhere(np.ones((2, 2, 2))), np.zeros(3), 0.5)
    blocks = blocks_from_mesh(mesh)
    coarse = blocks.coarse
    np.testing.assert_allclose(
        prolongation(blocks) @ coarse.nodes.prod(axis=1), mesh.nodes.prod(axis=1)
    )


# Pictures


def test_surface_quads_enclose_the_volume():
    mesh, _ = random_mesh()
    corners = mesh.nodes[surface_quads(mesh)]
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2
    # Divergence theorem: positive only if every quad is seen anticlockwise from outside.
    volume = (corners.mean(axis=1) * area).sum() / 3
    assert volume == pytest.approx(mesh.volume)


def test_objects_stand_upright(meshes):
    for name in BUILTINS:
        voxels = voxelize(load_surface(f"builtin:{name}"), 20, components="largest")
        assert guess_up(hexmesh_from_voxels(voxels)) == "z", name
    for file in ("stanford-bunny", "teapot"):
        voxels = voxelize(load_surface(str(meshes / f"{file}.obj")), 20, components="largest")
        assert guess_up(hexmesh_from_voxels(voxels)) == "y", file


def test_a_deformed_mesh_is_drawn_with_a_colour_bar(tmp_path):
    from matplotlib.figure import Figure

    mesh, _ = random_mesh()
    figure = Figure()
    axes = figure.add_subplot(projection="3d")
    figure.colorbar(draw(axes, mesh, displacement=np.sin(mesh.nodes), values=mesh.nodes[:, 0]))
    figure.savefig(tmp_path / "mesh.png")
    assert (tmp_path / "mesh.png").stat().st_size > 5000
    with pytest.raises(ValueError, match="values have shape"):
        draw(axes, mesh, values=np.zeros(3))
