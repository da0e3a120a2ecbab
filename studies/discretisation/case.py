"""One solid with one material by every way to a spectrum, against two truths."""

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.errors import ConvergenceError, UserError
from carillon.fem import geometry
from carillon.fem.materials import young_modulus
from carillon.fem.model import RIGID_MODES, Constants
from carillon.fem.regions import Regions
from carillon.limits import require_constants
from solver.accuracy.material import INTERPOLATED, PlacedMaterial
from solver.accuracy.voxels import voxel_lattice
from solver.analysis.problem import ProblemOptions
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.forest import FOREST
from solver.verification.matching import frequency_errors
from studies.discretisation.methods import TOLERANCE, TimedSpectrum, Ways, voxel_mesh
from studies.discretisation.truth import FINER, LEFT, LEFT_OF_NOISE, truth_between

NOISY = ("random", "noise")
"""Materials whose moduli jump from voxel to voxel."""
WARM_UP = ProblemOptions("builtin:box", 8)
"""Solid on which everything is compiled and loaded before the clock runs."""
WARM_UP_MODES = 12


def rate_discretisations(options: ProblemOptions, modes: int, runs: int) -> dict[str, Any]:
    """Errors, unknowns and wall time of one solid by every way, on this rank alone.

    The material is one function of place, defined by the voxels of `options.resolution`: `uniform`
    and `smooth` are interpolated between their middles, of all others each voxel has a modulus of
    its own, which finite cells of half the resolution see as means.

    Raises UserError for anything wrong with the solid, or if it has too few unknowns.

    Returns plain values: `truth`, see `truth_between`, and `ways`, see `Ways`: unknowns, seconds,
    and errors `against` the `solid` and against its `voxels`.

    Parameters
    ----------
    options
        The solid; how it is discretised and coarsened is left to the ways.
    modes
        Number of modes, rigid ones included.
    runs
        Rounds, in each of which every way runs once; medians of the seconds are told.
    """
    coarsening = replace(options, coarsen=FOREST).coarsening()
    assert coarsening is not None
    for way in _ways(WARM_UP, coarsening, WARM_UP_MODES).named.values():
        way()
    ways = _ways(options, coarsening, modes)
    found: dict[str, list[TimedSpectrum]] = {name: [] for name in ways.named}
    for _ in track(range(runs), "rounds"):
        for name, way in ways.named.items():
            found[name].append(_named(name, way))
    left = LEFT_OF_NOISE if options.material in NOISY else LEFT
    truth = truth_between(found["cells"][0], ways.cells(FINER), left)
    truths = {
        "solid": np.array(truth["frequencies_hz"]),
        "voxels": found["voxels"][0].hertz[RIGID_MODES:],
    }
    return {
        "mesh": options.mesh,
        "resolution": options.resolution,
        "material": options.material,
        "seed": options.seed,
        "poisson": options.poisson,
        "modes": modes,
        "tolerance": TOLERANCE,
        "runs": runs,
        **coarsening.record(),
        "truth": truth,
        "ways": {name: _described(spectra, truths) for name, spectra in found.items()},
    }


def _ways(options: ProblemOptions, coarsening: Coarsening, modes: int) -> Ways:
    require_constants(options.poisson, options.density)
    surface = geometry.load_surface(options.mesh, options.unit)
    name = geometry.surface_name(options.mesh)
    mesh = voxel_mesh(surface, options.resolution, options.components, name)
    label = f"mesh '{name}', resolution {options.resolution}"
    material = PlacedMaterial.of_voxels(
        voxel_lattice(surface, options.resolution),
        mesh,
        young_modulus(options.material, mesh, options.seed, label),
        options.material in INTERPOLATED,
    )
    constants: Constants = {"regions": Regions.one(options.poisson, options.density)}
    solid = (surface, name, options.components, options.resolution, material, constants)
    return Ways(*solid, coarsening, modes)


def _named(name: str, way: Callable[[], TimedSpectrum]) -> TimedSpectrum:
    try:
        return way()
    except (UserError, ConvergenceError) as error:
        raise type(error)(f"{name}: {error}") from None


def _described(spectra: list[TimedSpectrum], truths: dict[str, Array]) -> dict[str, Any]:
    first = spectra[0]
    totals = [sum(spectrum.seconds.values()) for spectrum in spectra]
    elastic = first.hertz[RIGID_MODES:]
    errors = {
        name: asdict(frequency_errors(elastic / exact - 1.0, len(first.hertz)))
        for name, exact in truths.items()
    }
    return {
        "n_dofs": first.n_dofs,
        "seconds": float(np.median(totals)),
        "spread": {"min": min(totals), "max": max(totals)},
        "phases": {
            phase: float(np.median([spectrum.seconds[phase] for spectrum in spectra]))
            for phase in first.seconds
        },
        "against": errors,
        "frequencies_hz": elastic.tolist(),
    }
