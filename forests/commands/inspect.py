"""Validate a file of forests, and say what is in it."""

import argparse
import json
from pathlib import Path
from typing import Any

from forests.default import default_path
from forests.model import load_model


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", nargs="?", help="by default that of the forests of Carillon")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Read the forests and print their summary."""
    description = describe(default_path() if arguments.file is None else arguments.file)
    print(json.dumps(description, indent=2) if arguments.json else as_text(description))


def describe(path: str | Path) -> dict[str, Any]:
    """Validate the model at `path` and summarise it.

    Raises UserError, see `forests.model.load_model`.
    """
    model = load_model(path)
    return {
        "path": str(path),
        "objective": model.objective,
        "poisson": model.poisson,
        "poisson_range": list(model.ratios),
        "transform": model.transform,
        "trees": model.forests.trees,
        "nodes": len(model.forests.nodes),
        "leaves": len(model.forests.leaves),
        "memory_bytes": model.nbytes,
        "scores": model.scores,
        "provenance": model.provenance,
    }


def as_text(summary: dict[str, Any]) -> str:
    """The result of `describe` as lines."""
    lines = [
        f"{summary['path']}: forests of objective {summary['objective']} at Poisson's ratio "
        f"{summary['poisson']}, for {_ratios(summary)}, {summary['transform']} features",
        f"2 x {summary['trees']} trees, {summary['leaves']:,} leaves, "
        f"{summary['memory_bytes'] / 1e6:.1f} MB in memory",
    ]
    lines += [f"{name:<28}{value:.6g}" for name, value in summary["scores"].items()]
    lines.append(f"commit {summary['provenance'].get('commit', 'unknown')}")
    return "\n".join(lines)


def _ratios(summary: dict[str, Any]) -> str:
    least, largest = summary["poisson_range"]
    return f"solids of {least:g} to {largest:g}" if least < largest else "solids of that one"
