"""Write the resolved configuration beside the results."""

import yaml

from carillon.files import atomic_path

with atomic_path(snakemake.output[0]) as temporary:
    temporary.write_text(yaml.safe_dump(snakemake.params.config, sort_keys=False))
