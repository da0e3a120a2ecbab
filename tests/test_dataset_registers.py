"""Lanes and tiles follow the registers of the processor compiled for, and results do not."""

import pkgutil
from importlib import import_module

import numpy as np
import pytest
from llvmlite import binding
from numba.core.dispatcher import Dispatcher

import carillon
import dataset_gen
import forests
import solver
import sound
from carillon.numerics import simd, simd_width
from carillon.numerics.simd_width import LANES, OTHERS, X86, registers_in
from dataset_gen.objectives.compiled import PANEL, panel_of
from dataset_gen.objectives.kernel import COLUMNS
from dataset_gen.objectives.oversampled import RIGID_SHARE
from tests.fits_of_target import fits

ROUNDING = np.finfo(float).eps / RIGID_SHARE
"""What rounding may change: energies that are that share of the largest count in the whitening."""

TARGETS = {"generic": 2, "haswell": 4}
"""Doubles of a register."""


@pytest.mark.parametrize(
    ("assembly", "found"),
    [
        ("vaddpd %zmm0, %zmm1, %zmm0\nvmovapd %ymm2, (%rdi)", X86["zmm"]),
        ("vaddpd %ymm0, %ymm1, %ymm0\nvmovsd %xmm2, (%rdi)", X86["ymm"]),
        ("addpd %xmm1, %xmm0", X86["xmm"]),
        ("fadd v0.2d, v0.2d, v1.2d", OTHERS),
    ],
)
def test_registers_are_told_from_the_code(assembly, found):
    assert registers_in(assembly) == found


@pytest.mark.parametrize("kind", [*X86.values(), OTHERS])
def test_a_tile_fits_the_registers_and_panels_divide_the_columns(kind):
    panel = panel_of(kind)
    assert 3 * panel + 3 + 1 <= kind.number and COLUMNS % panel == 0


def test_a_lane_takes_one_register():
    assert LANES == simd_width.REGISTERS.doubles and PANEL == panel_of(simd_width.REGISTERS)


def test_another_width_is_compiled_under_another_name(monkeypatch):
    name = simd.digest_of()
    monkeypatch.setattr(simd, "REGISTERS", OTHERS)
    assert simd.digest_of() != name


def test_no_closure_is_compiled():
    """Those of one factory share a name in numba's cache, and runs would call each other's."""
    packages = [carillon, dataset_gen, forests, solver, sound]
    names = [
        module.name
        for package in packages
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        if not module.name.endswith("__main__")
    ]
    compiled = [
        value.py_func.__qualname__
        for name in names
        for value in vars(import_module(name)).values()
        if isinstance(value, Dispatcher)
    ]
    assert len(compiled) > 50
    assert not [name for name in compiled if "<locals>" in name]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("target", "objectives"),
    [
        ("haswell", ["calibrated"]),
        pytest.param("haswell", ["inertial", "chen2015", "energy"], marks=pytest.mark.nightly),
        pytest.param("generic", ["calibrated", "inertial"], marks=pytest.mark.nightly),
    ],
)
def test_fits_differ_by_rounding_between_widths_and_not_with_their_company(
    target, objectives, start_cli, tmp_path
):
    features = binding.get_host_cpu_features()
    if target == "haswell" and not (features.get("avx2") and features.get("fma")):
        pytest.skip("the processor has no AVX2")
    path = tmp_path / "fits.npz"
    forced = {"NUMBA_CPU_NAME": target, "NUMBA_CPU_FEATURES": ""}
    start_cli("tests.fits_of_target", path, *objectives, env=forced, check=True)
    found, here = np.load(path), fits(*objectives)
    assert found["lanes"] == TARGETS[target] and found["panel"] in (3, 6)
    for objective in objectives:
        np.testing.assert_array_equal(found[objective], found[f"{objective}, alone"])
        np.testing.assert_array_equal(here[objective], here[f"{objective}, alone"])
        np.testing.assert_allclose(found[objective], here[objective], rtol=ROUNDING)
