"""The Snakemake workflow: rules, configuration, report, validation and cluster jobs."""

import carillon
