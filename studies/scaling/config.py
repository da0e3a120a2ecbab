"""What the jobs of the study take."""

from workflow.configuration.resources import JobLimits

LIMITS = {
    "measure_scaling": JobLimits("wall time over ranks, also in the report of the run", 16000, 120)
}
