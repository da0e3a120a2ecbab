"""The study of the forests: errors on single blocks, ways to train, rows, speed."""

from carillon.command_line.commands import Command

NEEDS = ("blocks",)

COMMANDS = {
    "variants": Command(
        "studies.forests.variants_command", "other ways to train, of equal storage", room="forests"
    ),
    "curve": Command(
        "studies.forests.curve_command", "error over the rows trained on", room="forests"
    ),
    "benchmark-forests": Command(
        "studies.forests.benchmark_command",
        "time of a block, of loading, over the size",
        room="forests",
        in_room="benchmark",
    ),
}
PAGES = {"forests_study": "what the default forests are worth"}
