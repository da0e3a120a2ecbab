"""The study of measured and published frequencies: is an error the mesh's or the data's?"""

from carillon.command_line.commands import Command

NEEDS = ("accuracy",)

COMMANDS = {
    "measured": Command(
        "studies.measured.command",
        "errors against measured and published frequencies, beside those that are expected",
        room="solver",
    ),
    "fit-constants": Command(
        "studies.measured.fit_command",
        "elastic constants of a measured solid from its frequencies, without a mesh",
    ),
}
