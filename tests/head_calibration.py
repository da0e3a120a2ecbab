"""How near calibrations come to the head of a listener who is simulated.

    python -m tests.head_calibration [--folder FOLDER] [--listeners 20] [--noise 0.25]

Heads are those of a folder, or 40 made ones (`tests.synthetic_heads`).  A hidden head is taken from
them, and the others are blended; or it stays among them.  The listener prefers the blend that is
nearer to the hidden head, in dB over all directions, bands and delays, tells apart what differs by
0.2 dB, and calls it definite from 0.6 dB on; each answer is off by noise.  Printed is the distance
after 120 comparisons, median and worst, for calibration as Carillon has it, as the thesis has it
(Algorithm 1: costs within a generation alone), and for random blends of which the winner stays;
beside them the nearest other head and the nearest blend that there is.
"""

import argparse
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.command_line.exit_status import run
from carillon.command_line.progress import say
from sound.heads.calibration import HeadCalibration, calibration_of
from sound.heads.head_space import HeadSpace, read_heads
from sound.heads.measured_head import head_of_responses
from sound.heads.preference import OFFSETS
from tests.synthetic_heads import RATE, drawn, made_head, sphere_directions

COMPARISONS = 120
MADE, SPACING = 40, 20.0
"""Number of made heads, and the angle between their directions [degrees]."""
SLIGHT, DEFINITE = 0.2, 0.6
"""Differences of distances [dB] from which an answer is 2 or 4, and 1 or 5."""
CONTINUITY = 5.0
"""Weight of continuity beside relative scores (the thesis' omega)."""
UNEVEN = 0.5
"""Spread of weights, as a natural logarithm, by which a listener of another metric hears."""


@dataclass
class Listener:
    """A listener whose ears are the hidden features (D,) [dB]; `weighing` (D,) is their metric."""

    space: HeadSpace
    hidden: Array
    noise: float
    random: np.random.Generator
    weighing: Array | float = 1.0

    def distance(self, point: Array) -> float:
        """Distance [dB] of the blend at a point (K,)."""
        return self.between(self.space.features_at(point))

    def between(self, features: Array) -> float:
        """Distance [dB] of features (D,)."""
        return float(np.linalg.norm(self.weighing * (features - self.hidden)))

    def compare(self, first: Array, second: Array) -> int:
        """Score of two points, from 1 (the first is definitely better) to 5."""
        off = self.noise * self.random.standard_normal()
        better = self.distance(second) - self.distance(first) + off
        limits = np.array([DEFINITE, SLIGHT, -SLIGHT, -DEFINITE])
        return 1 + int((better <= limits).sum())

    def nearest_blend(self) -> float:
        """Distance [dB] of the best point of the space."""
        mean = self.space.features_at(np.zeros(self.space.dimensions))
        directions = np.stack(
            [self.space.features_at(each) - mean for each in np.eye(self.space.dimensions)], axis=1
        )
        weighing = np.broadcast_to(self.weighing, self.hidden.shape)[:, None]
        point = np.linalg.lstsq(
            weighing * directions, weighing[:, 0] * (self.hidden - mean), rcond=None
        )[0]
        return self.distance(point)


def by_calibration(listener: Listener, seed: int) -> Array:
    """The point after all comparisons of a `HeadCalibration`."""
    calibration = calibration_of(listener.space, seed)
    answer_all(calibration, listener)
    return calibration.best


def answer_all(calibration: HeadCalibration, listener: Listener, count: int = COMPARISONS) -> None:
    """Let a listener answer until so many comparisons are made."""
    while calibration.count < count:
        calibration.answer(listener.compare(*calibration.next_pair()))


def at_random(listener: Listener, seed: int) -> Array:
    """The winner of random blends, each compared with the best one before."""
    random = np.random.default_rng(seed)
    best = np.zeros(listener.space.dimensions)
    for _ in range(COMPARISONS):
        other = random.standard_normal(len(best))
        if listener.compare(other, best) < 3:
            best = other
    return best


def by_thesis(listener: Listener, seed: int) -> Array:
    """The mean of CMA-ES after all comparisons, by Algorithm 1 of the thesis.

    Costs of each generation are found by least squares from its own pairs; a Gaussian process of
    them gives the gradients of two steps of L-BFGS.
    """
    import cma
    from scipy.optimize import minimize
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    size = listener.space.dimensions
    settings = {"popsize": 8, "seed": seed + 1, "verbose": -9}
    strategy = cma.CMAEvolutionStrategy(np.zeros(size), 1.0, settings)
    for _ in range(COMPARISONS // 4):
        points = np.array(strategy.ask())
        costs = absolute_costs(
            points, [listener.compare(*pair) for pair in points.reshape(4, 2, -1)]
        )
        strategy.tell(list(points), costs.tolist())
        kernel = ConstantKernel(1.0) * RBF(3.0, (1.0, 10.0)) + WhiteKernel(0.1)
        process = GaussianProcessRegressor(kernel).fit(points, costs)
        begin = strategy.mean.copy()
        move = minimize(
            lambda point, process=process: process.predict(point[None])[0],
            begin,
            method="L-BFGS-B",
            options={"maxiter": 2},
        ).x
        move = move - begin
        strategy.mean = begin + move * min(1.0, strategy.sigma / max(np.linalg.norm(move), 1e-9))
    return np.asarray(strategy.mean)


def absolute_costs(points: Array, scores: list[int]) -> Array:
    """Costs (N,) of points (N, K) of which each two neighbours were compared (Eqs. 5.8 to 5.11)."""
    count = len(points)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = 1.0 - apart / apart.sum(axis=1, keepdims=True)
    np.fill_diagonal(near, 0.0)
    relative = np.kron(np.eye(count // 2), [1.0, -1.0])
    equations = np.concatenate([relative, np.sqrt(CONTINUITY) * (np.eye(count) - near)])
    offsets = [-OFFSETS[score] for score in scores]
    return np.asarray(
        np.linalg.lstsq(equations, np.concatenate([offsets, np.zeros(count)]), rcond=None)[0]
    )


WAYS: dict[str, Callable[[Listener, int], Array]] = {
    "calibration": by_calibration,
    "thesis, Algorithm 1": by_thesis,
    "random, winner stays": at_random,
}


def made_heads(count: int = MADE, spacing: float = SPACING, seed: int = 7) -> HeadSpace:
    """Made heads, of which `seed` tells which."""
    random = np.random.default_rng(seed)
    directions = sphere_directions((-40.0, 90.0), spacing)
    return HeadSpace(
        [
            head_of_responses(made_head(drawn(random), directions, f"head-{number}"), float(RATE))
            for number in range(count)
        ]
    )


def listener_of(
    space: HeadSpace, number: int, noise: float, is_left_out: bool, uneven: float = 0.0
) -> tuple[Listener, float]:
    """A listener whose head is that of a number, and how near [dB] the nearest other one is."""
    hidden = space.features[number]
    others = [head for other, head in enumerate(space.heads) if other != number]
    random = np.random.default_rng([number, 1])
    weighing = np.exp(uneven * random.standard_normal(len(hidden))) if uneven else 1.0
    folder = HeadSpace(others) if is_left_out else space
    listener = Listener(folder, hidden, noise, random, weighing)
    nearest = min(listener.between(each) for each in np.delete(space.features, number, axis=0))
    return listener, nearest


def compare(space: HeadSpace, count: int, noise: float, is_left_out: bool, uneven: float) -> None:
    """Print how near each way comes."""
    rows: dict[str, list[float]] = {}
    numbers = np.round(np.linspace(0, len(space.heads) - 1, min(count, len(space.heads))))
    for done, number in enumerate(numbers.astype(int)):
        say(f"listener {done + 1} of {len(numbers)}", sys.stderr.isatty(), end="\r")
        for name, way in WAYS.items():
            listener, nearest = listener_of(space, number, noise, is_left_out, uneven)
            rows.setdefault(name, []).append(listener.distance(way(listener, int(number))))
        rows.setdefault("nearest other head", []).append(nearest)
        rows.setdefault("nearest blend", []).append(listener.nearest_blend())
    print(f"{'distance [dB]':22}{'median':>8}{'worst':>8}  nearer than every other head")
    for name, distances in rows.items():
        nearer = np.array(distances) < np.array(rows["nearest other head"])
        values = f"{np.median(distances):8.2f}{max(distances):8.2f}"
        print(f"{name:22}{values}  {nearer.sum()} of {len(distances)}", flush=True)
    print()


def main(options: argparse.Namespace) -> None:
    """Measure and print."""
    warnings.simplefilter("ignore")  # of Gaussian processes whose length scale is at its bound
    space = read_heads(options.folder) if options.folder else made_heads()
    print(f"{len(space.heads)} heads, {space.dimensions} components, {COMPARISONS} comparisons\n")
    for title, noise, is_left_out, uneven in (
        ("the hidden head is left out", options.noise, True, 0.0),
        ("the hidden head is among the blended ones", options.noise, False, 0.0),
        ("left out, twice the noise", 2.0 * options.noise, True, 0.0),
        ("left out, the listener's metric is another one", options.noise, True, UNEVEN),
    ):
        print(f"{title}; noise of answers {noise:g} dB")
        compare(space, options.listeners, noise, is_left_out, uneven)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.head_calibration")
    parser.add_argument("--folder", help="measured heads (SOFA) in place of made ones")
    parser.add_argument("--listeners", type=int, default=20, help="number of listeners")
    parser.add_argument("--noise", type=float, default=0.25, help="of answers [dB]")
    given = parser.parse_args()
    raise SystemExit(run("head_calibration", lambda: main(given)))
