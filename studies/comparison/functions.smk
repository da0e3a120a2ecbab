# Functions of the rules of the comparison.


def require_baseline(wildcards):
    """No files: they may be those of the rule `reference`, which must not be made anew for this."""
    if not config["baseline"]:
        raise WorkflowError("baseline: names no folder, run with --config baseline=FOLDER")
    return []
