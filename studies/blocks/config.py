"""What the jobs of the study take."""

from workflow.configuration.resources import JobLimits

LIMITS = {
    "rate_forests": JobLimits(
        "errors of the forests on single blocks, also in their study", 2000, 30
    )
}
