"""Examples of sound design, each with a page: `snakemake sounds`."""

from carillon.command_line.commands import Command

NEEDS = ("recordings",)

COMMANDS = {
    "sounds": Command("studies.base.page_command", "page: examples of sound design"),
    "sounds_of_recordings": Command(
        "studies.base.page_command", "page: sound design from real recordings"
    ),
}
