"""The Snakemake workflow: rules, configuration, schemas, scripts and the report."""

import carillon
