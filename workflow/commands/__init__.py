"""Commands around the rules: before, after, and for one solid."""

from carillon.command_line.commands import Command

COMMANDS = {
    "rules": Command(
        "workflow.commands.rules", "where Snakemake finds the rules: snakemake -s $(carillon rules)"
    ),
    "estimate": Command(
        "workflow.commands.estimate",
        "core-hours, memory and storage of a configuration, before anything runs",
    ),
    "compile": Command(
        "workflow.commands.compile", "kernels, once and side by side, before many jobs start"
    ),
    "digest": Command(
        "workflow.commands.digest",
        "what result files say, as one number: equal for runs that found the same bits",
    ),
    "crate": Command(
        "workflow.commands.crate",
        "a run as one ZIP file for an archive, described as RO-Crate",
    ),
    "validate": Command(
        "workflow.commands.validate",
        "one solid against ground truth, ending at a page that says how far to trust it",
    ),
}
