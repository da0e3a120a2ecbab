"""Errors of the eigenvalues and modes of modes files, another being taken for the truth."""

import argparse
import json
from typing import Any

from carillon.records.provenance import record
from solver.commands.running import on_ranks, parameters, require_outputs, write_json
from solver.distribution.collective import bcast_from_root
from solver.verification.comparison import compare_each

OTHER_SHAPE = 0.5
"""Angle [rad] from which two modes are different ones."""
EXAMPLES = """examples:
  compare bunny.h5 truth.h5
  compare coarse.h5 average.h5 truth.h5 --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument(
        "candidates", nargs="+", metavar="candidate", help="modes files to judge, one or several"
    )
    parser.add_argument("truth", help="modes file taken for the truth")
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Compare and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        compared = bcast_from_root(
            comm, lambda: compare_each(arguments.candidates, arguments.truth)
        )
        comparisons = {name: each.as_dict() for name, each in compared.items()}
        content = {"comparisons": comparisons, "provenance": record(parameters(arguments))}
        write_json(arguments, content, comm)
        if comm.rank:
            return
    if arguments.json:
        print(json.dumps(content, indent=2))
        return
    for name, comparison in comparisons.items():
        if len(comparisons) > 1:
            print(f"{name}:")
        _print(comparison)


def _print(comparison: dict[str, Any]) -> None:
    error = comparison["eigenvalue_relative_error"]
    print(f"modes compared            {comparison['modes_compared']} (elastic)")
    print(
        f"eigenvalue error          median {error['median']:.2e}, 90 % below {error['p90']:.2e}, "
        f"max {error['max']:.2e}"
    )
    print(f"frequency error, rms      {comparison['frequency_rms_relative_error']:.2e}")
    print(
        f"frequency error, 7..60    rms {comparison['frequency_rms_relative_error_7_60']:.2e}, "
        f"max {comparison['frequency_max_relative_error_7_60']:.2e}"
    )
    if "matched" in comparison:
        print(f"modes matched by shape    {_matched(comparison['matched'])}")
    print(f"largest subspace angle    {comparison['subspace_angle_max']:.2e} rad")
    print(f"largest 2-norm residual   {comparison['residual_max']:.2e}")
    if "material" in comparison:
        print(f"material                  {_differences(comparison['material'])}")
    if "matched" not in comparison and (lost := _lost(comparison["clusters"])):
        print(f"modes of other shapes     {lost}")


def _differences(material: dict[str, Any]) -> str:
    parts = []
    if "young" in material:
        young = material["young"]
        parts.append(
            f"Young's modulus of {young['cells']:,} of {young['all']:,} cells, by up to "
            f"{young['largest']:.2g} of the truth's"
        )
    for name, noun in (("poisson", "Poisson's ratio"), ("density_kg_per_m3", "density [kg/m3]")):
        if name in material:
            own, truth = material[name]
            parts.append(f"{noun} {own:.6g}, the truth's {truth:.6g}")
    if "elasticity" in material:
        own, truth = (", ".join(names) for names in material["elasticity"])
        parts.append(f"elasticity of {own}; the truth's of {truth}")
    return f"another one: {'; '.join(parts)}"


def _lost(clusters: list[dict[str, Any]]) -> str:
    """Modes of the truth that those of the same numbers are not, in words; empty if there are none.

    Both are on one mesh, so that a mode that is left out or there twice shifts all later ones.
    """
    lost = [cluster for cluster in clusters if cluster["angle"] > OTHER_SHAPE]
    if not lost:
        return ""
    count = sum(cluster["last"] - cluster["first"] + 1 for cluster in lost)
    return (
        f"{count}, the first is {lost[0]['first']}: modes crossed, one is missing or there twice, "
        "or the material is another; see `carillon audit`"
    )


def _matched(errors: dict[str, Any]) -> str:
    if not errors["modes"]:
        return "none"
    return (
        f"{errors['modes']}, {errors['moved']} of them under another number; frequency error, "
        f"rms {errors['rms']:.2e}, worst {errors['worst']:+.2e} (mode {errors['worst_mode']})"
    )
