"""From result files to tables, figures and one self-contained page."""

NEEDS = ("benchmark", "blocks", "convergence", "scaling")
"""Studies whose rules measure what the report shows."""
