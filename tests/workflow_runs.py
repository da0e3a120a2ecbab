"""Snakemake on the rules of the checkout (test support)."""

import subprocess
import sys
from pathlib import Path

from tests.patience import HANG_SECONDS
from tests.programs import CHECKOUT, checkout_environment

TINY = CHECKOUT / "workflow" / "config" / "tiny.yaml"
LAPTOP = CHECKOUT / "workflow" / "config" / "laptop.yaml"
PROFILE = CHECKOUT / "workflow" / "profiles" / "default"


def snakemake(
    folder: Path, *arguments: object, timeout: float = HANG_SECONDS
) -> subprocess.CompletedProcess[str]:
    """Run Snakemake on the Snakefile of the checkout, with `folder` as working directory."""
    command = [sys.executable, "-m", "snakemake", "-s", CHECKOUT / "Snakefile", *arguments]
    environment = checkout_environment()
    return subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=timeout,
    )


def finished(folder: Path, *targets: str, configfile: Path = TINY) -> Path:
    """Make targets in `folder`, the tiny ones unless another configuration is named; return it."""
    done = snakemake(folder, *targets, "--profile", PROFILE, "--configfile", configfile)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-6000:]
    return folder


def planned(done: subprocess.CompletedProcess[str]) -> dict[str, int]:
    """Jobs of a dry run by rule."""
    output = done.stdout + done.stderr
    assert done.returncode == 0, output
    lines = output[output.index("Job stats:") :].splitlines()[3:]
    table = [line.split() for line in lines[: lines.index("")]]
    return {rule: int(count) for rule, count in table}
