"""What the Snakefile does with a configuration before any rule: as a program that can be forked."""

from __future__ import annotations

import sys

from snakemake.common.configfile import load_configfile
from snakemake.utils import validate

from carillon.command_line import exit_status
from workflow import settings


def main() -> None:
    """Load and check the configuration named."""
    config = load_configfile(sys.argv[1])
    settings.check(config)
    validate(config, str(settings.SCHEMA))
    settings.check_links(config)


if __name__ == "__main__":
    sys.exit(exit_status.run("configure", main))
