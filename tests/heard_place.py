"""Designs for a place, heard there and elsewhere.

    python -m tests.heard_place [SOLID] [--clip CLIP] [--seconds S] [--radiation boundary-elements]

Two designs are sought for one clip on a built-in solid: one as others are, whose amplitudes are
those of the struck point, and one for a place 60 degrees above the horizon.  The clip is what the
solid would be heard like there if it were of another material, unless another one is named.
Printed is, for both, how far amplitudes are from the clip's, as they are struck, at that place, and
at others: E_a of the cost (Eq. 2) on the fine solid, and rms [dB] of the partials less than 20 dB
below the loudest.
Then the gradient of the heard amplitudes is compared with central differences.  Boundary elements
take some minutes a place.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.processes.threads import one_thread
from solver.files.modes_file import frequencies
from sound.clips.targets import Targets
from sound.design.optimise import optimise
from sound.design.preparation import DesignProblem, prepare
from sound.project.project import Project, project_of

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
MODES, LOWEST, HIGHEST = 12, 1000.0, 8000.0
"""Modes of the other material, their lowest frequency [Hz], and about their highest."""
LOUD = 0.1
"""Amplitude of a partial over the loudest below which its level is not compared."""


def problems(options: argparse.Namespace, folder: Path) -> dict[str, DesignProblem]:
    """The search as it is struck, and those for the places."""
    clip = options.clip or folder / "nothing.wav"
    if not options.clip:
        clip.touch()
    described = {
        "mesh": f"builtin:{options.solid}",
        "modes": "auto" if options.clip else MODES,
        "targets": [{"name": "strike", "clip": str(clip), "vertex": options.vertex}],
        "optimiser": {"seconds": options.seconds, "workers": 1},
    }
    projects = {"struck": project_of(described, folder)}
    for name, way in PLACES.items():
        listen = {"at": [AWAY * each for each in way], "radiation": options.radiation}
        projects[name] = project_of({**described, "listen": listen}, folder)
    targets = None if options.clip else heard_targets(projects["there"])
    return {name: prepare(project, targets) for name, project in projects.items()}


def heard_targets(project: Project) -> Targets:
    """What the solid of a random material is heard like at the place of a project."""
    hertz, amplitudes = np.geomspace(LOWEST, HIGHEST, MODES), np.ones((1, MODES))
    some = Targets(("clip",), hertz, np.full(MODES, 5.0), amplitudes, (np.zeros(1),), (44_100,))
    for _ in range(2):  # The band follows from the frequencies.
        setting = prepare(project, some).setting
        z = 0.5 * np.random.default_rng(1).standard_normal(setting.material.dimensions)
        with one_thread():
            at = setting.fine().simulation(1e-9).evaluate(z)
        hertz = frequencies(at.eigenvalues)
        balance = setting.objective.balance(at.eigenvalues, at.pushed)
        some = replace(some, frequencies=hertz * LOWEST / hertz[0], amplitudes=balance)
    return some


def off(problem: DesignProblem, z: Array) -> str:
    """E_a, and rms error of the loud partials, of a material of coordinates z."""
    objective = problem.setting.objective
    with one_thread():
        at = problem.setting.fine().simulation(1e-6).evaluate(z)
    residual = objective.amplitude_residual(at.eigenvalues, at.pushed)
    balance = objective.balance(at.eigenvalues, at.pushed)
    wanted = balance - residual
    loud = np.zeros(balance.shape[1], dtype=bool)
    loud[objective.targets.sounding] = True
    loud &= wanted[0] > LOUD
    errors = 20.0 * np.log10(balance[0, loud] / wanted[0, loud])
    return f"{0.5 * (residual**2).sum():8.3f} {np.sqrt((errors**2).mean()):7.1f} dB"


def gradient_error(problem: DesignProblem) -> float:
    """How far the derivatives of the heard amplitudes are from differences along one direction."""
    setting = problem.setting
    objective = setting.objective
    with one_thread():
        # Forests have kinks, which differences see.
        simulation = setting.fine().simulation(1e-12)
        random = np.random.default_rng(0)
        z = 0.2 * random.standard_normal(setting.material.dimensions)
        way = random.standard_normal(len(z)) / np.sqrt(len(z))

        def residual(move: float) -> Array:
            at = simulation.evaluate(z + move * way)
            return objective.amplitude_residual(at.eigenvalues, at.pushed)

        expected = (residual(STEP) - residual(-STEP)) / (2.0 * STEP)
        at = simulation.evaluate(z, derivatives=True)
        assert at.sensitivity is not None
        exact = objective.amplitude_jacobian(at.eigenvalues, at.pushed, at.sensitivity) @ way
    return float(np.linalg.norm(exact - expected) / np.linalg.norm(expected))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.heard_place")
    parser.add_argument("solid", nargs="?", default="bar", metavar="SOLID")
    parser.add_argument("--clip", help="a sound file in place of another material")
    parser.add_argument("--vertex", type=int, default=0, help="that is struck")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each search")
    parser.add_argument("--radiation", default="sphere")
    options = parser.parse_args()
    try:
        with tempfile.TemporaryDirectory() as folder:
            each = problems(options, Path(folder))
            designs = [optimise(each[name]) for name in ("struck", "there")]
    except UserError as error:
        parser.exit(1, f"{error}\n")
    print(
        f"{'heard':>10} {'designed as struck':>20} {'for the place':>20}   E_a, loud partials rms"
    )
    for name, problem in each.items():
        # All searches have the same coordinates.
        cells = " ".join(f"{off(problem, design.coordinates):>20}" for design in designs)
        print(f"{name:>10} {cells}", flush=True)
    print(f"gradient of heard amplitudes off differences by {gradient_error(each['there']):.1e}")


if __name__ == "__main__":
    main()
