"""The paper's Fig. 10 and 11 and the scaling over ranks, in full and on a page of their own."""

from carillon.command_line.commands import Command

NEEDS = ("benchmark", "convergence", "scaling")

COMMANDS = {
    "figures": Command(
        "studies.base.page_command",
        "page: the paper's Fig. 10 and 11 and the scaling over ranks, in full",
    ),
}
