"""Loss factors of regions: what they make of the modes, and where their dampings are heard."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
import scipy.linalg as la

from carillon.fem.model import RIGID_MODES
from solver.analysis.problem import ProblemOptions
from solver.assembly.sparse import assembled
from solver.distribution.partition import partition_cells
from sound.__main__ import main
from sound.design.material import ReducedMaterial
from sound.design.optimise import optimise
from sound.design.outcome import fitted_loss_factors
from sound.design.preparation import prepare
from sound.design.simulation import Simulation
from sound.project.design import MaterialDamping
from sound.project.design_file import read_design, write_design
from sound.rendering.solid import SoundingSolid
from tests import small_project
from tests.small_design import N_MODES, small_design
from tests.test_sound_gradient import MODES, block_mesh, strikes

SHAPE = (6, 4, 3)
REGIONS = 3
LOSS = np.array([1e-3, 4e-3, 2e-2])


def analysed(coarsen):
    """A block of an uneven material, its modes and its regions."""
    mesh = block_mesh(SHAPE)
    material = ReducedMaterial.of_mesh(mesh, 6, 1e9, "exponential")
    options = ProblemOptions("block", 8, coarsen=coarsen)
    simulation = Simulation(mesh, options, material, strikes(SHAPE), MODES, tolerance=1e-13)
    evaluation = simulation.evaluate(np.random.default_rng(3).normal(0.0, 0.7, 6))
    return simulation, evaluation, partition_cells(mesh, REGIONS)


def with_damping():
    """A small design with loss factors."""
    design = small_design()
    random = np.random.default_rng(4)
    loss = random.uniform(1e-3, 1e-2, len(design.young))
    return replace(design, damping=MaterialDamping(loss, 3.0, random.uniform(2.0, 9.0, N_MODES)))


@pytest.mark.parametrize("coarsen", ["none", "average", "ddfem"])
def test_shares_of_energy_add_up_and_are_derivatives_of_the_eigenvalues(coarsen):
    simulation, evaluation, regions = analysed(coarsen)
    shares = simulation.energy_shares(evaluation, regions)
    assert shares.shape == (MODES, REGIONS)
    # Leaves of the forests tell scales apart by numbers of single precision.
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-6)
    young = simulation.material.moduli(evaluation.z)
    step = 1e-4
    for region in range(REGIONS):
        moved = []
        for sign in (1.0, -1.0):
            factors = np.where(regions == region, np.exp(sign * step), 1.0)
            modes = simulation.elements.solve(simulation.solver, factors * young, None)
            moved.append(np.log(modes.values[RIGID_MODES:]))
        slopes = (moved[0] - moved[1]) / (2.0 * step)
        np.testing.assert_allclose(shares[:, region], slopes, atol=1e-4)


def test_dampings_are_those_of_a_complex_stiffness():
    """K (1 + i eta) in every region: the decay of its modes, to first order of eta."""
    simulation, evaluation, regions = analysed("none")
    shares = simulation.energy_shares(evaluation, regions)
    young = simulation.material.moduli(evaluation.z)
    stiffness, mass = assembled(simulation.elements.with_young(young))
    lost, _ = assembled(simulation.elements.with_young(LOSS[regions] * young))
    values = la.eigvals(stiffness.toarray() + 1j * lost.toarray(), mass.toarray())
    values = values[np.argsort(values.real)][RIGID_MODES : RIGID_MODES + MODES]
    omega = np.sqrt(evaluation.eigenvalues)
    np.testing.assert_allclose(np.sqrt(values).imag, 0.5 * omega * (shares @ LOSS), rtol=1e-3)


@pytest.mark.parametrize("mass", [0.0, 8.0])
def test_loss_factors_are_found_again_and_none_is_negative(mass):
    simulation, evaluation, regions = analysed("none")
    shares = simulation.energy_shares(evaluation, regions)
    hertz = np.sqrt(evaluation.eigenvalues) / (2.0 * np.pi)
    wanted = 0.5 * mass + np.pi * hertz * (shares @ LOSS)
    found = fitted_loss_factors(shares, hertz, wanted)
    np.testing.assert_allclose(found[0], LOSS, rtol=1e-3)
    assert found[1] == pytest.approx(mass, abs=1e-2)
    odd = fitted_loss_factors(shares, hertz, wanted[::-1])
    assert odd[0].min() >= 0.0 and odd[1] >= 0.0


def test_a_design_finds_the_loss_factors_of_its_solid(tmp_path):
    """Clips damped by one loss factor; ends of a bar, which they cannot tell apart, are alike."""
    made = small_project.project(tmp_path, evaluations=1)
    targets = small_project.targets(made)
    wanted = np.pi * 5e-3 * optimise(prepare(made, targets)).frequencies
    made = replace(made, damping=replace(made.damping, source="material"))
    designed = optimise(prepare(made, replace(targets, dampings=wanted)))
    np.testing.assert_allclose(designed.damping.loss_factors, 5e-3, rtol=1e-4)
    np.testing.assert_allclose(designed.dampings, wanted, rtol=1e-4)
    np.testing.assert_array_equal(designed.damped_by("clips").dampings, wanted)


def test_loss_factors_come_back_and_old_files_have_none(tmp_path):
    design = with_damping()
    write_design(tmp_path / "new.h5", design)
    write_design(tmp_path / "old.h5", small_design())
    read = read_design(tmp_path / "new.h5").damping
    np.testing.assert_array_equal(read.loss_factors, design.damping.loss_factors)
    np.testing.assert_array_equal(read.dampings, design.damping.dampings)
    assert read.mass_per_second == 3.0
    assert read_design(tmp_path / "old.h5").damping is None
    short = replace(design.damping, loss_factors=design.damping.loss_factors[1:])
    with pytest.raises(ValueError, match="loss factors of shape"):
        write_design(tmp_path / "bad.h5", replace(design, damping=short))


def test_the_material_is_heard_where_it_is_asked_for(tmp_path, capsys, refuses):
    design = with_damping()
    write_design(tmp_path / "new.h5", design)
    write_design(tmp_path / "old.h5", small_design())
    words = ["--target", "corner", "--json", "--out", str(tmp_path / "hit.wav")]

    def heard(*more):
        assert main(["render", str(tmp_path / "new.h5"), *words, *more]) == 0
        return json.loads(capsys.readouterr().out)["dampings_per_second"]

    np.testing.assert_allclose(heard(), design.targets.dampings)
    np.testing.assert_allclose(heard("--damping-from", "material"), design.damping.dampings)
    settings = {**design.settings, "damping": {"source": "material", "regions": 4}}
    write_design(tmp_path / "new.h5", replace(design, settings=settings))
    np.testing.assert_allclose(heard(), design.damping.dampings)
    np.testing.assert_allclose(heard("--damping-from", "clips"), design.targets.dampings)
    said = refuses(main, "render", tmp_path / "old.h5", *words, "--damping-from", "material")
    assert "no loss factors" in said


def test_exports_hold_loss_factors_and_the_dampings_asked_for(tmp_path):
    design = with_damping()
    write_design(tmp_path / "design.h5", design)
    words = ["export", str(tmp_path / "design.h5"), "--out", str(tmp_path / "out.h5")]
    assert main([*words, "--damping-from", "material"]) == 0
    with h5py.File(tmp_path / "out.h5") as file:
        np.testing.assert_array_equal(file["fine/loss_factors"], design.damping.loss_factors)
        np.testing.assert_array_equal(file["dampings"], design.damping.dampings)
    solid = SoundingSolid.of_design(design)
    np.testing.assert_array_equal(solid.dampings, design.targets.dampings)
