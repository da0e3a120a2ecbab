"""Models agree with measured solids, and differ from what is not them."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy.optimize import brentq
from scipy.special import spherical_jn, spherical_yn

from carillon.composition.entries import RegionEntry
from carillon.errors import UserError
from carillon.fem.elasticity import elasticity_matrix
from carillon.parameters.documents import parameters_from
from solver.__main__ import main
from studies.accuracy.anisotropic_box import box_frequencies
from studies.accuracy.domains import cylinder
from studies.accuracy.ritz import free_eigenvalues
from studies.measured import fit_command
from studies.measured.crystals import elasticity, grain, turned
from studies.measured.data_files import FOLDER, solid_names
from studies.measured.fit import fitted
from studies.measured.measure import CELLS, WITHOUT, MeasuredOptions, as_text, rated
from studies.measured.measure import measured as solid_and_models
from studies.measured.solid import FREE, MeasuredSolid, read_solid
from studies.measured.verdict import AGREES, DIFFERS, TOO_COARSE

SOLIDS = {name: read_solid(name) for name in solid_names()}
MESHLESS = [name for name, solid in SOLIDS.items() if solid.degrees is not None]
TOO_HIGH = "code-aster-thick-ring"
"""A solid whose published frequencies are above a bound from above."""
FEWER = 4
"""Degrees that the tests leave out, for speed."""


def meshless_verdict(solid: MeasuredSolid) -> str:
    return rated(solid, solid.without_a_mesh(FEWER), 0.001, None)["verdict"]


def with_factors(solid: MeasuredSolid, factor: float) -> MeasuredSolid:
    """The solid of another modulus, or of another shear constant."""
    material = solid.material
    if material.elastic is None:
        return replace(solid, material=replace(material, young=factor * material.young))
    constants = material.elastic.constants
    other = {**constants, "c44": factor * constants["c44"]}
    elastic = replace(material.elastic, constants=other)
    return replace(solid, material=replace(material, elastic=elastic))


@pytest.mark.parametrize("name", SOLIDS)
def test_a_data_file_is_whole(name):
    solid = SOLIDS[name]
    known = solid.hertz[np.isfinite(solid.hertz)]
    assert len(known) >= 5 and (np.diff(known) >= 0.0).all()
    assert any(word.strip("(),").isdigit() for word in solid.source.reference.split()) or (
        "https://" in solid.source.reference
    )
    assert 0.0 < solid.frequencies.uncertainty <= 0.05 and solid.frequencies.why
    assert solid.is_run == (solid.left_out == "")
    assert (solid.supports == FREE) == (not solid.held) or not solid.is_run
    for by in solid.frequencies.others:
        assert solid.others_hertz(by).shape == solid.hertz.shape
    surface = solid.geometry.surface()
    assert surface.is_watertight and surface.volume > 0.0


@pytest.mark.parametrize(
    ("name", "volume"),
    [
        ("titanium-block", 7.753e-3 * 9.057e-3 * 13.199e-3),
        ("steel-cylinder", 29.7024e-3 / 7826.136),
        ("nafems-fv41-free-cylinder", np.pi * (2.2**2 - 1.8**2) * 10.0),
        ("nafems-fv42-hollow-sphere", 4.0 / 3.0 * np.pi * (6.0**3 - 1.8**3)),
        ("nafems-fv6-ring", 2.0 * np.pi**2 * 0.05**2),
        ("nafems-fv22-thick-rhombus", 100.0 * np.sin(np.pi / 4.0)),
        ("nafems-fv32-tapered-membrane", 10.0 * 3.0 * 0.05),
        ("fan-blade", 0.3048**2 * 0.003048),
    ],
)
def test_surfaces_enclose_the_volume_of_the_solid(name, volume):
    assert SOLIDS[name].geometry.surface().volume == pytest.approx(volume, rel=1e-4)


def test_the_fork_has_the_sizes_of_its_drawing():
    """CoFEA's drawing: 96.74 mm long, 14.4 mm wide, 3 mm thick; its arcs begin at 30 mm."""
    surface = SOLIDS["tuning-fork"].geometry.surface()
    assert np.allclose(sorted(surface.extents), [0.003, 0.0144, 0.09674])
    bar, stem = sorted(surface.split(), key=lambda part: -part.volume)
    exact = 3e-3**2 * (2.0 * 66.74e-3 + np.pi * 5.7e-3)
    assert bar.volume == pytest.approx(exact, rel=1e-3)
    assert stem.bounds[1, 2] == pytest.approx(30e-3 - 5.7e-3)


@pytest.mark.parametrize("name", MESHLESS)
def test_solutions_without_a_mesh_agree_and_differ_with_a_constant_that_is_wrong_by_3_percent(name):
    solid = SOLIDS[name]
    assert meshless_verdict(solid) == (DIFFERS if name == TOO_HIGH else AGREES)
    for factor in (0.97, 1.03):
        assert meshless_verdict(with_factors(solid, factor)) == DIFFERS


def test_published_frequencies_that_are_too_high_are_found_out():
    """Rayleigh and Ritz's are never too low, whatever the degrees."""
    solid = SOLIDS[TOO_HIGH]
    assert (solid.without_a_mesh() < 0.998 * solid.hertz).all()


def test_constants_of_one_crystal_are_those_of_another():
    """Of the third nothing was fitted but how it is turned."""
    second, third = (SOLIDS[f"cmsx-4-crystal-{number}"].material for number in (2, 3))
    assert second.elastic.constants == third.elastic.constants
    assert (second.fitted, third.fitted) == (6, 3)


def test_a_density_and_a_side_that_are_wrong_differ_too():
    solid = SOLIDS["titanium-block"]
    heavier = replace(solid.material, density=1.03 * solid.material.density)
    assert meshless_verdict(replace(solid, material=heavier)) == DIFFERS
    dimensions = {**solid.geometry.dimensions, "x": 1.02 * solid.geometry.dimensions["x"]}
    assert (
        meshless_verdict(replace(solid, geometry=replace(solid.geometry, dimensions=dimensions)))
        == DIFFERS
    )


@pytest.mark.parametrize("name", ["titanium-block", "steel-cylinder", "aluminium-block"])
def test_fits_find_the_constants_of_the_files(name):
    start = with_factors(SOLIDS[name], 1.01)
    found = fitted(start, FEWER)
    assert found.rms < SOLIDS[name].frequencies.uncertainty
    pairs = zip(found.solid.material.isotropic, SOLIDS[name].material.isotropic, strict=True)
    (young, given), (poisson, told) = pairs
    assert young == pytest.approx(given, rel=3e-3) and poisson == pytest.approx(told, abs=3e-3)


def test_the_command_tells_a_fit(capsys):
    class Arguments:
        solid = "steel-cylinder"

    fit_command.run(Arguments())
    assert "49 frequencies: 0.079% rms" in capsys.readouterr().out


def test_a_solid_without_polynomials_cannot_be_fitted():
    with pytest.raises(UserError, match="Ring, NAFEMS FV6 has no solution without a mesh"):
        fitted(SOLIDS["nafems-fv6-ring"])


def test_the_hollow_sphere_has_the_radial_motions_of_its_file():
    """Of u = j1(k r) and y1(k r), the radial stress vanishes on both surfaces."""
    solid = SOLIDS["nafems-fv42-hollow-sphere"]
    young, poisson = solid.material.isotropic
    shear = 0.5 * young / (1.0 + poisson)
    lame = 2.0 * shear * poisson / (1.0 - 2.0 * poisson)
    speed = np.sqrt((lame + 2.0 * shear) / solid.material.density)

    def stress(wave, k, r):
        strain = k * wave(1, k * r, derivative=True)
        return (lame + 2.0 * shear) * strain + 2.0 * lame * wave(1, k * r) / r

    def equation(hertz):
        k = 2.0 * np.pi * hertz / speed
        inner, outer = (
            [stress(wave, k, r) / young for wave in (spherical_jn, spherical_yn)]
            for r in (1.8, 6.0)
        )
        return inner[0] * outer[1] - inner[1] * outer[0]

    for hertz in solid.hertz:
        exact = brentq(equation, 0.99 * hertz, 1.01 * hertz)
        assert hertz == pytest.approx(exact, rel=solid.frequencies.uncertainty)


def test_the_free_cylinder_has_the_motions_of_its_file():
    solid = SOLIDS["nafems-fv41-free-cylinder"]
    degrees = (10, 10, 16)
    domain = cylinder((4.4, 4.4, 10.0), degrees, bore=3.6 / 4.4)
    values = free_eigenvalues(domain, degrees, *solid.material.isotropic, solid.material.density)
    found = np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi)
    for hertz in solid.hertz:
        assert np.abs(found / hertz - 1.0).min() < solid.frequencies.uncertainty


def test_the_deep_beam_stretches_and_twists_as_its_file_says():
    """Quarter waves; the torsion constant of a square is 0.1406 of its side's fourth power."""
    solid = SOLIDS["nafems-fv5-deep-beam"]
    young, poisson = solid.material.isotropic
    stretch = np.sqrt(young / solid.material.density) / 40.0
    twist = stretch * np.sqrt(0.1406 * 6.0 / (2.0 * (1.0 + poisson)))
    for exact in (stretch, twist, 3.0 * twist):
        assert np.abs(solid.hertz / exact - 1.0).min() < 1e-3


def test_crystals_have_their_moduli_along_their_axes():
    constants = {"c11": 5.0, "c33": 6.0, "c12": 2.0, "c13": 1.0, "c44": 1.5}
    hexagonal = elasticity("hexagonal", constants)
    assert np.allclose(turned(hexagonal, (0.0, 0.0, 17.0)), hexagonal)
    upright = turned(hexagonal, (90.0, 0.0, 0.0))
    assert upright[1, 1] == pytest.approx(6.0) and upright[2, 2] == pytest.approx(5.0)
    assert turned(hexagonal, (0.0, 20.0, 0.0))[0, 5] != pytest.approx(0.0, abs=1e-3)
    tetragonal = elasticity("tetragonal", {**constants, "c66": 1.2, "c16": 0.3})
    assert np.allclose(turned(tetragonal, (0.0, 0.0, 90.0)), tetragonal)
    with pytest.raises(ValueError, match="expected c11, c12, c44"):
        elasticity("cubic", constants)
    with pytest.raises(ValueError, match="some strain would set free"):
        elasticity("cubic", {"c11": 1.0, "c12": 2.0, "c44": 1.0})


@pytest.mark.parametrize("name", ["cmsx-4-crystal", "ylf-crystal"])
def test_regions_of_crystals_have_the_elasticity_of_their_files(name):
    """Nine constants and two directions, of a tetragonal crystal turned until c16 vanishes."""
    solid = SOLIDS[name]
    entry = parameters_from(solid.composition["regions"][0], RegionEntry)
    region = entry.row()
    matrix = region.young[0] * region.laws[0].rotated(entry.axes()).matrix
    exact = solid.material.elasticity
    assert np.allclose(matrix, exact, atol=1e-6 * exact[0, 0])


def test_less_symmetry_than_three_planes_is_refused():
    monoclinic = elasticity("cubic", {"c11": 3.0, "c12": 1.0, "c44": 1.0})
    monoclinic[0, 4] = monoclinic[4, 0] = 0.2
    with pytest.raises(ValueError, match="without three planes of symmetry"):
        grain(monoclinic, (0.0, 0.0, 0.0))


def test_a_held_plate_and_a_crystal_agree_with_their_files():
    options = MeasuredOptions(finer=0.7, refine_to=0.01)
    plate = measured_solid("nafems-fv52-supported-plate", options)
    # The motions in the plane do not feel the supports, and are those of a free plate.
    sides, elasticities = (10.0, 10.0, 1.0), 200e9 * elasticity_matrix(0.3)
    free = box_frequencies(sides, (12, 12, 4), elasticities, 8000.0, 20)
    for hertz in (193.58, 206.14):
        assert np.abs(free / hertz - 1.0).min() < 1e-3
        assert np.abs(np.array(plate["hertz"]) / hertz - 1.0).min() < 4e-3
    assert plate["verdict"] == AGREES
    crystal = measured_solid("cmsx-4-crystal-2", options)
    exact = SOLIDS["cmsx-4-crystal-2"].without_a_mesh()
    assert np.allclose(crystal["hertz"], exact, rtol=4.0 * crystal["mesh"])


def measured_solid(name: str, options: MeasuredOptions) -> dict:
    """A solid's finite cells, as plain values."""
    models = solid_and_models(name, SOLIDS[name], options)["models"]
    return next(model for model in models if model["model"] == CELLS)


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What the command writes of the steel cylinder, and of one whose modulus is 3 % too high."""
    folder = tmp_path_factory.mktemp("measured")
    document = yaml.safe_load((FOLDER / "steel-cylinder.yaml").read_text())
    constants = document["material"]["elastic"]["constants"]
    constants |= {"c11": "283.74 GPa", "c44": "84.91 GPa"}
    document["frequencies"]["values"] = document["frequencies"]["values"][:20]
    (folder / "mine.yaml").write_text(yaml.safe_dump(document))
    out = folder / "measured.json"
    words = ["--solids", f"steel-cylinder,{folder / 'mine.yaml'},nafems-fv2-double-cross"]
    assert main(["measured", *words, "--finer", "0.8", "--out", str(out)]) == 0
    return json.loads(out.read_text())


def test_finite_cells_agree_where_voxels_cannot_tell(measured):
    solid = measured["solids"][0]
    without, cells, voxels = solid["models"]
    assert [model["verdict"] for model in solid["models"]] == [AGREES, AGREES, TOO_COARSE]
    assert without["model"] == WITHOUT and without["compared"] == 49
    assert cells["rms"] == pytest.approx(without["rms"], abs=1.5 * cells["mesh"])
    assert cells["mesh"] < solid["uncertainty"] < voxels["mesh"]
    # What the cells are off is what they expect, within a factor of three.
    ratio = np.array(cells["hertz"]) / without["hertz"] - 1.0
    assert 1.0 / 3.0 < cells["mesh"] / np.sqrt(np.mean(ratio**2)) < 3.0


def test_a_modulus_that_is_too_high_differs_by_every_model_that_can_tell(measured):
    mine = measured["solids"][1]
    assert mine["solid"] == "mine"
    for model in mine["models"][:2]:
        assert model["verdict"] == DIFFERS
        assert model["mean"] == pytest.approx(np.sqrt(1.03) - 1.0, abs=2e-3)


def test_a_solid_that_is_left_out_waits(measured):
    waiting = measured["solids"][2]
    assert waiting["models"] == [] and waiting["supports"].startswith("Tips turn")
    text = as_text(measured)
    assert "It lists motions in its plane alone" in text and text.count("differs") >= 2


def test_mistakes_get_one_sentence(refuses, tmp_path):
    said = refuses(main, "measured", "--solids", "titanium-block,cube")
    assert "'cube' is unknown, expected some of aluminium-block" in said
    path = tmp_path / "mine.yaml"
    text = (FOLDER / "titanium-block.yaml").read_text()
    path.write_text(text.replace("118.68 GPa", "118.68"))
    assert "mine.yaml, line" in refuses(main, "measured", "--solids", str(path))
    path.write_text(text.replace("118.68 GPa", "118.68 psi"))
    assert "expected a number and one of Pa, MPa, GPa" in refuses(
        main, "measured", "--solids", str(path)
    )
    path.write_text(text.replace("z: 13.199", "height: 13.199"))
    assert "expected x, y, z" in refuses(main, "measured", "--solids", str(path))
    path.write_text(text.replace("poisson: 0.3195", "poisson: null"))
    assert "neither or both" in refuses(main, "measured", "--solids", str(path))
