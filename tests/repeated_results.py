"""Small results of every kind in one file: `python tests/repeated_results.py OUT.npz FOLDER`.

Run again in other circumstances, it tells what the results depend on.
"""

import sys
from pathlib import Path

import numpy as np

from dataset_gen.generate import generate
from dataset_gen.settings import ShardOptions
from forests.training.dataset import dataset_of
from forests.training.options import TrainingOptions
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from sound.design.optimise import optimise
from sound.design.preparation import prepare
from tests import small_project, solids
from tests.small_forests import train

TOLERANCE = 1e-7


def results(folder: Path) -> dict[str, np.ndarray]:
    """Arrays by a name that begins with their kind: shard, forests, design, or modes."""
    shard = generate(ShardOptions(1000, 3), progress=False)
    model = train(dataset_of([shard]), TrainingOptions(trees=1, max_leaves=60), progress=False)
    project = small_project.project(folder, evaluations=15)
    small_project.write_clips(folder, np.linspace(400.0, 3000.0, project.modes))
    design = optimise(prepare(project))
    made = {f"forests/{name}": values for name, values in vars(model.forests).items()}
    made |= {"shard/fine": shard.fine, "shard/coarse": shard.coarse}
    made |= {"design/coordinates": design.coordinates, "design/young": design.young}
    made |= {"design/modes": design.modes, "design/cost": design.history["cost"]}
    # Large enough that BLAS shares its work among threads.
    box = solids.random_box(16, 8, 6)
    methods = {
        "synthesis": SolverOptions(modes=60, corrections=0),
        "corrected": SolverOptions(modes=60, tolerance=TOLERANCE),
        "slepc": SolverOptions(modes=60, method="slepc"),
    }
    for name, options in methods.items():
        modes = modal_analysis(box, options)
        made |= {f"modes/{name}/values": modes.values, f"modes/{name}/vectors": modes.vectors}
    return made


if __name__ == "__main__":
    np.savez(sys.argv[1], **results(Path(sys.argv[2])))
