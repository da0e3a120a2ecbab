"""What the study is made of."""

from studies.base.study import Study
from studies.campaign.cells import cells_of

CAMPAIGN = Study(
    name="campaign",
    title="Validations of solids, materials, seeds and ranks",
    results="results:Campaign",
    tables=("cells", "solids", "provenance"),
    target=False,
    measured=lambda config: [f"cells/{cell.path}.json" for cell in cells_of(config)],
)
