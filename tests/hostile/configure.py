"""What the Snakefile does with a configuration before any rule: as a program that can be forked."""

import sys

from snakemake.common.configfile import load_configfile

from carillon.command_line import exit_status
from workflow import settings


def main() -> None:
    """Load and check the configuration named."""
    load_configfile(sys.argv[1])
    settings.check_files(settings.complete([sys.argv[1]]), [sys.argv[1]])


if __name__ == "__main__":
    sys.exit(exit_status.run("configure", main))
