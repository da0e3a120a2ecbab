"""Commands of sound design: from clips to a material to sounds."""

from carillon.command_line.commands import Command

COMMANDS = {
    "extract": Command(
        "sound.commands.extract", "modes of a sound clip: frequency, damping, amplitude"
    ),
    "clip": Command("sound.commands.clip", "synthesise a clip of a struck metal, wood or string"),
    "init": Command("sound.commands.init", "a project file to begin with, all keys in it"),
    "design": Command(
        "sound.commands.design", "optimise the material until struck points sound as clips"
    ),
    "check": Command(
        "sound.commands.check", "frequencies of a design on the fine solid, beside its targets"
    ),
    "reach": Command("sound.commands.reach", "which modes that a design misses its solid can have"),
    "render": Command("sound.commands.render", "the sound of a strike, as WAV"),
    "heads": Command("sound.commands.heads", "measured heads of a folder, and blends of them"),
    "export": Command(
        "sound.commands.export", "modes on the mesh, glTF, Faust or moduli, for other tools"
    ),
}
