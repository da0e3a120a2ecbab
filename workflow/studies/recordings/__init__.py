"""How much of real recordings extraction finds, each with a page: `snakemake recordings`."""
