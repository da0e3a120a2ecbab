"""What the jobs of the study take."""

from workflow.configuration.resources import JobLimits

LIMITS = {
    "follow_convergence": JobLimits(
        "history of the corrections in the report of the run", 8000, 120
    )
}
