"""What the jobs of the study take."""

from workflow.configuration.resources import JobLimits

LIMITS = {
    "time_extraction_start": JobLimits("start of the extraction of modes", 1000, 10),
    "extract_recording": JobLimits("modes of a real recording", 4000, 60),
    "compare_formats": JobLimits("modes of a recording in several formats", 4000, 60),
}
