"""Write the project file of an edit of an example."""

import yaml

from carillon.files import atomic_path

with atomic_path(snakemake.output[0]) as temporary:
    temporary.write_text(yaml.safe_dump(snakemake.params.project, sort_keys=False))
