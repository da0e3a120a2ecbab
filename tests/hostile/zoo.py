"""Files that programs meet: valid ones that Carillon itself has made, and hostile ones.

Made once per session, in a folder that nothing may change afterwards.
"""

from pathlib import Path

from tests.hostile import zoo_growing, zoo_hdf5, zoo_meshes, zoo_numbers, zoo_texts
from tests.hostile.cases import Place
from tests.hostile.places import KINDS, put_place
from tests.zygote import Job, Zygote

SOLID = "builtin:box --resolution 4"
"""Of 24 voxels, which the materials of the zoo are for."""
VOXELS = 24

MAKERS = (
    "dataset_gen generate --samples 200 --out shard.h5",
    "dataset_gen generate --samples 200 --shard 1 --shards 2 --out half.h5",
    "dataset_gen generate --samples 200 --objective hybrid --poisson 0.3 --out other.h5",
    "forests train shard.h5 --trees 1 --depth 3 --out forests.h5",
    "forests grow shard.h5 --trees 1 --depth 3 --tree 0 --out tree0.h5",
    "forests grow shard.h5 --trees 1 --depth 3 --tree 1 --out tree1.h5",
    f"solver modes {SOLID} --modes 12 --method slepc --out modes.h5",
    f"solver modes {SOLID} --modes 10 --method slepc --material random --out random.h5",
    "solver modes builtin:bar --resolution 8 --modes 12 --method slepc --out bar.h5",
    "solver respond modes.h5 random.h5 --out response.h5",
    "sound clip metal --seconds 0.5 --rate 22050 --out metal.wav",
    "sound clip wood --seconds 0.3 --rate 22050 --out wood.wav",
    "sound design project.yaml --evaluations 2 --out design.h5",
)
"""Commands that make the valid files, in order."""

PROJECT = """\
mesh: builtin:bar
resolution: 16
coarsen: none
modes: 6
targets:
  - {name: end, at: [-0.12, 0.0, 0.03], clip: metal.wav}
  - {name: side, at: [0.04, 0.0225, 0.02], clip: wood.wav}
material: {dimensions: 10}
optimiser: {seconds: null, evaluations: 4, workers: 1}
"""
CONFIGURATION = """\
models: {bar: {mesh: 'builtin:bar', resolution: 20, material: two-region}}
dataset: {samples: 600, distributions: [uniform], shards: 2}
forests: {trees: 1, depth: 6}
solver: {modes: 12, cores: 1}
"""


class Zoo:
    """The folder of the files."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @classmethod
    def made(cls, folder: Path, zygote: Zygote) -> "Zoo":
        """Make all files in `folder`, with programs that `zygote` runs."""
        folder.mkdir(parents=True)
        folder.chmod(0o755)
        (folder / "project.yaml").write_text(PROJECT)
        (folder / "config.yaml").write_text(CONFIGURATION)
        for command in MAKERS:
            room, *arguments = command.split()
            outcome = zygote.run(Job(room, arguments, str(folder)))
            assert outcome.status == 0, f"python -m {command}\n{outcome.stderr}"
        zoo_meshes.make(folder)
        zoo_numbers.make(folder, VOXELS)
        zoo_hdf5.make(folder)
        zoo_growing.make(folder)
        zoo_texts.make(folder, PROJECT, CONFIGURATION)
        _make_odd_places(folder)
        return cls(folder)


def _make_odd_places(folder: Path) -> None:
    """What is there but no file, or a file only by a detour."""
    odd = folder / "odd"
    odd.mkdir()
    for end in ("obj", "npy", "wav", "h5", "yaml", "txt", "json"):
        for kind in KINDS:
            put_place(odd / f"{kind}.{end}", Place(kind, target=f"{kind}.{end}"))
        put_place(odd / f"dangling.{end}", Place("link", target="nowhere"))
