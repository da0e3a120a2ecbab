"""Write the verdict of a campaign for programs."""

import json
from pathlib import Path

from carillon.files.atomic import atomic_path
from studies.base.study import logged
from studies.campaign.results import Campaign
from studies.campaign.verdict import as_json, as_junit

with logged(snakemake.log):
    study = Campaign(Path(snakemake.output.json).parent)
    with atomic_path(snakemake.output.json) as temporary:
        temporary.write_text(json.dumps(as_json(study), indent=2))
    with atomic_path(snakemake.output.junit) as temporary:
        temporary.write_text(as_junit(study), encoding="utf-8")
