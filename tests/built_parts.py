"""Designs built of real materials, and modes of their parts as other programs would have them.

    python -m tests.built_parts [CASE...]    metals, wood, infill

Each case is a real clip on a built-in solid: the field is sought, restricted to materials, exported
as parts, and read again. Printed are errors of the partials [cents] and distance from the clip [dB]
of the field, of the nearest materials and as built; whether admesh and trimesh find the parts
closed; and how far off frequencies are that `carillon modes` finds for the parts: on voxels as the
design has them, and on voxels of half their edge, where more of the surface is seen. Clips are
those of Sonic Pi (package sonic-pi-samples), parts are cut by the surface where manifold3d is
installed, admesh is Debian's. Takes some minutes on one core.
"""

import argparse
import contextlib
import io
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import trimesh
import yaml

from solver.__main__ import main as solver_main
from solver.files.modes_file import read_modes
from sound.__main__ import main
from sound.design.pitch import cents, stretch_to
from sound.export.parts_folder import ALL, REGIONS, WHOLE, write_parts
from sound.project.design import Design
from sound.project.design_file import read_design

SAMPLES = Path("/usr/share/sonic-pi/samples")
CASES = {
    "metals": ("bar", "perc_bell", {"materials": ["aluminium", "steel"]}),
    "wood": ("bar", "elec_triangle", {"materials": ["softwood", "brass"], "at_least": "10 mm"}),
    "infill": ("bar", "elec_triangle", {"infill": "pla", "infill_levels": 5, "at_least": "8 mm"}),
}
"""Built-in solid, clip and build of each case."""
RESOLUTION = 32
EVALUATIONS = 400


def designed(name: str, folder: Path) -> Path:
    """The file of the built design of a case."""
    solid, clip, build = CASES[name]
    project = {
        "mesh": f"builtin:{solid}",
        "resolution": RESOLUTION,
        "targets": [
            {"name": "end", "clip": str(SAMPLES / f"{clip}.flac"), "at": [-0.12, 0.0, 0.03]}
        ],
        "optimiser": {"seconds": None, "evaluations": EVALUATIONS},
        "build": build,
    }
    (folder / f"{name}.yaml").write_text(yaml.safe_dump(project))
    out = folder / f"{name}.h5"
    _run(main, ["design", str(folder / f"{name}.yaml"), "--out", str(out)])
    return out


def frequencies_of_parts(folder: Path, design: Design, *how: str) -> np.ndarray:
    """Elastic frequencies (N,) [Hz] of the parts in a folder, found by `carillon modes`."""
    out = folder / "modes.h5"
    solid = ["modes", str(folder / WHOLE), "--unit", "mm", "--regions", str(folder / REGIONS)]
    count = len(design.eigenvalues)
    _run(solver_main, [*solid, *how, "--modes", str(count), "--out", str(out)])
    return np.asarray(read_modes(out).frequencies[count - len(design.frequencies) :])


def closed(path: Path) -> str:
    """What trimesh and admesh say of a surface."""
    surface = trimesh.load(path)
    said = "closed" if surface.is_watertight and surface.is_winding_consistent else "open"
    if shutil.which("admesh") is None:
        return said
    told = subprocess.run(["admesh", path], capture_output=True, text=True, check=True).stdout
    faults = [
        int(line.split(":")[1].split()[-1])
        for line in told.splitlines()
        if line.startswith(("Total disconnected", "Degenerate", "Edges fixed", "Facets removed"))
    ]
    return f"{said}, admesh {'finds no fault' if not any(faults) else faults}"


def off(hertz: np.ndarray, design: Design) -> str:
    """Median and worst distance [cents] of the partials from their targets, at their best pitch."""
    targets = design.targets
    stretched = hertz * stretch_to(hertz, targets)
    error = np.abs(cents(stretched, targets.frequencies))[targets.sounding]
    return f"{np.median(error):.1f} (worst {error.max():.1f})"


def show(name: str, folder: Path) -> None:
    """Print what is found in a case."""
    design = read_design(designed(name, folder))
    told = design.evidence["build"]
    solid, clip, build = CASES[name]
    print(f"{name}: {solid}, {clip}, {build}, {told['size']:.3f} times as large as its mesh")
    for part in ("before", "rounded", "after"):
        each = told[part]
        text = f"  {part:8} {each['median_cents']:.1f} cents (worst {each['worst_cents']:.1f})"
        if "distance_db" in each:
            text += f", {each['distance_db']:.1f} dB, {each['verdict']}"
        print(text)
    made = folder / name
    written = write_parts(made, design)
    print(f"  parts {'cut by the surface' if written.is_clipped else 'with faces of voxels'}")
    for row in written.rows:
        print(
            f"    {row['material']:10} {row['mass_g']:8.1f} g in {row['pieces']} pieces, "
            f"{closed(made / row['file'])}"
        )
    side = np.ptp(design.model.mesh.nodes, axis=0).max() / design.fine_edge
    for finer in (1, 2):
        resolution = str(finer * round(side))
        again = frequencies_of_parts(made, design, "--resolution", resolution, "--no-estimate")
        moved = cents(again, design.frequencies)
        print(
            f"  modes of {ALL} at resolution {resolution}: partials off by {off(again, design)}, "
            f"all modes {moved.min():+.2f} to {moved.max():+.2f} cents from the design's",
            flush=True,
        )


def _run(program, arguments: list[str]) -> None:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = program(arguments)
    if status:
        raise SystemExit(said.getvalue())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    with tempfile.TemporaryDirectory() as scratch:
        for case in parser.parse_args().cases or CASES:
            show(case, Path(scratch))
