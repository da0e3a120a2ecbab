"""Examples of sound design, each with a page: `snakemake sounds`."""
