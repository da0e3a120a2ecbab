"""Write a parameter of a rule as YAML, such as the resolved configuration beside the results."""

import yaml

from carillon.files.atomic import atomic_path
from studies.base.study import logged

with logged(snakemake.log), atomic_path(snakemake.output[0]) as temporary:
    temporary.write_text(yaml.safe_dump(snakemake.params.content, sort_keys=False))
