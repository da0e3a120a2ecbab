"""Designs for a place, heard there and elsewhere, by boundary elements.

    python -m tests.heard_place [SOLID] [--clip CLIP] [--seconds S] [--triangles N]

Two designs are sought for one clip on a built-in solid: one as others are, whose amplitudes are
those of the struck point, and one for a place 60 degrees above the horizon.  Printed is how far the
levels of the partials are from the clip's [dB, rms, after the best common gain] and how loud the
modes that shall be silent are beside them [dB], as boundary elements have both designs at that
place and in others.  At the place the directivity of the partials, found by another way (reciprocal
solutions for each mode, and spherical harmonics), is compared.  Then the gradient of the heard
amplitudes of the design's start is compared with central differences.  Needs bempp-cl; takes
half an hour on one core, most of it for boundary elements.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from carillon.arrays import Array, Complex
from carillon.errors import UserError
from carillon.fem.model import mass_properties
from carillon.processes.threads import one_thread
from sound.__main__ import main as sound_main
from sound.design.optimise import optimise
from sound.design.preparation import prepare
from sound.project.design import Design
from sound.project.project import project_of
from sound.radiation import modes_directivity
from sound.radiation.boundary_elements import radiated_by_elements
from sound.radiation.place import Place, transfer_to
from sound.rendering.solid import SoundingSolid, struck_amplitudes
from sound.shape import Shape

PLACES = {
    "there": (0.5, 0.0, 0.866),
    "opposite": (-0.5, 0.0, -0.866),
    "above": (0.0, 0.0, 1.0),
    "beside": (0.0, 1.0, 0.0),
}
"""Directions of the places, the first of which the design is for."""
AWAY = 2.0
"""Distance [m] of the places."""
STEP = 1e-5
"""Step of the central differences."""


def designs(solid: str, clip: str, seconds: float, folder: Path) -> list[Design]:
    """The design of a clip on a solid as it is struck, and that for the first place."""
    wav = folder / "clip.wav"
    if Path(clip).is_file():
        wav = Path(clip).resolve()
    elif sound_main(["clip", clip, "--seconds", "1.5", "--out", str(wav)]):
        raise SystemExit(1)
    described = {
        "mesh": f"builtin:{solid}",
        "targets": [{"name": "strike", "clip": str(wav), "vertex": 0}],
        "optimiser": {"seconds": seconds, "workers": 1},
    }
    at = [AWAY * each for each in PLACES["there"]]
    listen = {"at": at, "radiation": "boundary-elements"}
    found = []
    for project in (described, {**described, "listen": listen}):
        problem = prepare(project_of(project, folder))
        found.append(optimise(problem))
        if problem.setting.objective.heard is not None:
            check_gradient(problem)
    return found


def check_gradient(problem) -> None:
    """Print how far the gradient of the heard amplitudes is from differences."""
    setting = problem.setting
    objective = setting.objective
    with one_thread():
        # Forests have kinks, which differences see.
        simulation = setting.fine().simulation(1e-12)
        random = np.random.default_rng(0)
        z = 0.2 * random.standard_normal(setting.material.dimensions)
        way = random.standard_normal(len(z))
        way /= np.linalg.norm(way)

        def residual(move: float) -> Array:
            at = simulation.evaluate(z + move * way)
            return objective.amplitude_residual(at.eigenvalues, at.pushed)

        by_differences = (residual(STEP) - residual(-STEP)) / (2.0 * STEP)
        at = simulation.evaluate(z, derivatives=True)
        exact = objective.amplitude_jacobian(at.eigenvalues, at.pushed, at.sensitivity) @ way
    off = np.linalg.norm(exact - by_differences) / np.linalg.norm(by_differences)
    print(f"gradient of heard amplitudes against differences: {off:.1e}", flush=True)


def amplitudes(design: Design, heard: Complex | None) -> Array:
    """Amplitudes (N,) of a strike, where modes are `heard`."""
    solid = replace(SoundingSolid.of_design(design), heard=None)
    strike = design.strikes[0]
    pushed = np.einsum("pik,i->pk", solid.motion(strike.position[None]), strike.inward)
    return struck_amplitudes(pushed, design.frequencies, heard)[0]


def off(design: Design, heard: Complex | None) -> tuple[float, float]:
    """Rms error [dB] of the partials' levels, and level [dB] of silent modes beside them."""
    own, which = amplitudes(design, heard), design.targets.sounding
    wanted = design.targets.amplitudes[0][which]
    # Partials of one frequency are one.
    hertz, firsts = np.unique(design.targets.frequencies[which], return_index=True)
    sounding = np.array([own[which][design.targets.frequencies[which] == f].sum() for f in hertz])
    errors = 20.0 * np.log10(sounding / wanted[firsts])
    silent = np.delete(own, which)
    level = 10.0 * np.log10((silent**2).sum() / (own[which] ** 2).sum()) if len(silent) else -np.inf
    return float(errors.std()), float(level)


def at_place(design: Design, direction: tuple[float, ...]) -> Complex:
    """Pressures (N,) of a design's modes in a direction."""
    centre, shape = _about_centre(design)
    place = Place(centre + AWAY * np.array(direction), by_elements=True)
    hertz = float(design.targets.frequencies.min()), float(design.targets.frequencies.max())
    transfer = transfer_to(place, shape, centre, hertz, f"{design.name}")
    return transfer.heard(design.model, design.elastic_modes, design.frequencies)


def off_directivity(design: Design, heard: Complex) -> float:
    """Rms difference [dB] of the partials' pressures from their directivity at the place."""
    centre, shape = _about_centre(design)
    which = design.targets.sounding
    mesh, _ = modes_directivity.resolved_mesh(shape, float(design.frequencies.max()))
    motion = SoundingSolid.of_design(design).motion(mesh.vertices + centre)[:, :, which]
    directivity = radiated_by_elements(mesh, motion, design.frequencies[which])
    expected = directivity.towards(np.array([PLACES["there"]]))[0]
    differences = 20.0 * np.log10(np.abs(heard[which] / expected))
    print("Hz, level, difference [dB]:")
    for row in zip(design.frequencies[which], 20.0 * np.log10(np.abs(expected)), differences):
        print("".join(f"{value:10.2f}" for value in row))
    return float(np.sqrt((differences**2).mean()))


def _about_centre(design: Design) -> tuple[Array, Shape]:
    centre = mass_properties(design.model).centre
    return centre, Shape.of_surface(design.surface_vertices, design.surface_faces, centre)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.heard_place")
    parser.add_argument("solid", nargs="?", default="bar", metavar="SOLID")
    parser.add_argument("--clip", default="metal", help="an instrument, or a sound file")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each search")
    parser.add_argument("--triangles", type=int, help="of the solid's surface at least and most")
    options = parser.parse_args()
    if options.triangles:
        modes_directivity.FEWEST_TRIANGLES = modes_directivity.MOST_TRIANGLES = options.triangles
    try:
        with tempfile.TemporaryDirectory() as folder:
            struck, placed = designs(options.solid, options.clip, options.seconds, Path(folder))
        print(f"{'':>10}  {'as struck':>20}  {'for the place':>20}")
        print(f"{'heard':>10}" + 2 * f"  {'partials':>11} {'silent':>8}")
        rows = {
            name: [at_place(each, way) for each in (struck, placed)] for name, way in PLACES.items()
        }
        for name, heard in [("struck", [None, None]), *rows.items()]:
            found = [off(*each) for each in zip((struck, placed), heard)]
            cells = "".join(f"  {error:8.1f} dB {silent:5.1f} dB" for error, silent in found)
            print(f"{name:>10}{cells}", flush=True)
        different = off_directivity(placed, rows["there"][1])
        print(f"partials there, by directivity: {different:.2f} dB rms off")
    except UserError as error:
        parser.exit(1, f"{error}\n")


if __name__ == "__main__":
    main()
