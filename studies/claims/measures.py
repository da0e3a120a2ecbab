"""The function that measures each claim."""

from collections.abc import Callable

from studies.claims import of_blocks, of_motion, of_times
from studies.claims.findings import Finding
from studies.claims.results import Claims

MEASURES: dict[str, Callable[[Claims], Finding]] = {
    "shapes": of_motion.shapes,
    "blocks": of_blocks.blocks,
    "scaling": of_blocks.scaling,
    "evaluation": of_blocks.evaluation,
    "storage": of_blocks.storage,
    "training": of_blocks.training,
    "convergence": of_times.convergence,
    "total": of_times.total,
    "each": of_times.each,
    "interactive": of_times.interactive,
    "response": of_motion.response,
    "scene": of_motion.scene,
}
"""Measures of claims by the claim's name in `claims.yaml`."""
