"""What the jobs of the study take."""

from workflow.configuration.resources import JobLimits

LIMITS = {
    "time_methods": JobLimits("all methods in alternating runs, also in target figures", 8000, 240)
}
