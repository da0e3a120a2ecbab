"""Keep the small tables of a run as text."""

from pathlib import Path

from studies.comparison.reference import write_reference

write_reference(Path(snakemake.input.config).parent, snakemake.params.processor)
