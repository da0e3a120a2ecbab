"""How long scenes take, and how that grows: `python -m tests.scene_speed [--seconds S]`.

Bowls, bars and bells of several materials fall on a floor, and on each other.  The modes of each
kind are computed before the clock starts.
"""

import argparse
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from sound.scenes.playing.play import perform
from sound.scenes.scene import Scene
from sound.scenes.scene_file import scene_of

KINDS = tuple(product(("bowl", "bar", "bell", "plate", "pitcher"), ("glass", "steel")))
SPACING = 0.36
STAGES = ("motion", "contacts", "sound", "voices")


def pile(count: int, seconds: float, modes: int, steps: int = 16) -> Scene:
    """A scene of so many objects with so many modes each, that fall one after the other."""
    random = np.random.default_rng(1)
    side = max(2, round(np.sqrt(count / 4)))
    objects: list[dict[str, Any]] = []
    for number in range(count):
        shape, material = KINDS[number % len(KINDS)]
        place, layer = number % side**2, number // side**2
        x, y = SPACING * (place % side), SPACING * (place // side)
        objects.append(
            {
                "name": f"{number} {shape}",
                "mesh": f"builtin:{shape}",
                "material": material,
                "resolution": 20,
                "count": modes,
                "collision": "hull",
                "position": [x, y, 0.4 + SPACING * layer],
                "rotation": random.uniform(-180.0, 180.0, 3).tolist(),
            }
        )
    return scene_of({"objects": objects, "seconds": seconds, "engine": {"steps": steps}}, Path())


def main() -> int:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    cases = [(10, 40, 16), (10, 80, 16), (10, 160, 16), (10, 40, 32)]
    cases += [(20, 40, 16), (50, 40, 16), (100, 40, 16), (200, 40, 16)]
    perform(pile(10, 0.5, 40), visible=False)
    print("objects  modes  steps  impacts  impacts/s  " + "  ".join(STAGES) + "  all [s]")
    for count, modes, steps in cases:
        done = perform(pile(count, seconds, modes, steps), visible=False)
        times = [done.timings[stage] for stage in STAGES]
        busiest = np.bincount([int(each.seconds) for each in done.impacts]).max()
        print(
            f"{count:7}  {modes:5}  {steps:5}  {len(done.impacts):7}  {busiest:9}  "
            + "  ".join(f"{each:6.2f}" for each in times)
            + f"  {sum(times):7.2f}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
