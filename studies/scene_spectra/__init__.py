"""One scene, heard by the truth's modes and by coarse ones, and its page (the paper's Fig. 13)."""

from carillon.command_line.commands import Command

NEEDS = ("sounds",)

COMMANDS = {
    "scene_spectra": Command(
        "studies.base.page_command",
        "page: one scene by the truth's modes and by coarse ones (Fig. 13)",
    ),
}
