"""Validate one cell of a campaign."""

import json
from pathlib import Path

from carillon.files.atomic import atomic_path
from studies.campaign.running import validated

output = Path(snakemake.output[0])
result = validated(
    snakemake.params.arguments, output.with_suffix(""), snakemake.threads, Path(snakemake.log[0])
)
with atomic_path(output) as temporary:
    temporary.write_text(json.dumps(result, indent=2))
