"""Rows of `python -m studio`: scenes; the server has tests of its own."""

from tests.hostile.cases import Copy, Table
from tests.hostile.zoo_texts import hostile_yaml

TABLE = Table("studio")
hostile, control, each = TABLE.hostile, TABLE.control, TABLE.each

BALL = "{name: ball, radius: 0.01, material: steel, count: 0, position: [0, 0, 0.02]}"
MODES, DESIGN = Copy("modes.h5"), Copy("design.h5")
PLAY = "scene s.yaml --out o.wav"


def scene(*objects: str, **keys: str) -> str:
    """Text of a scene."""
    lines = [f"{key}: {value}" for key, value in {"seconds": "0.1", **keys}.items()]
    return "\n".join([*lines, "objects:", *(f"  - {each}" for each in objects or (BALL,))]) + "\n"


def ball(**keys: str) -> str:
    """An object."""
    given = {"name": "b", "radius": "0.01", "material": "steel", "count": "0", **keys}
    return "{" + ", ".join(f"{key}: {value}" for key, value in given.items() if value) + "}"


hostile("nothing at all", "", "command")
hostile("no such option", f"{PLAY} --loud", "--loud", files={"s.yaml": scene()})
hostile("no scene", "scene --out o.wav", "scene")
hostile("no out", "scene s.yaml", "--out", files={"s.yaml": scene()})
hostile("no such scene", "scene nowhere.yaml --out o.wav", "nowhere.yaml")
hostile("bars without notes", "scene builtin:bars --out o.wav", "--notes")
hostile("notes of a scene", f"{PLAY} --notes C4", "--notes", files={"s.yaml": scene()})
each(
    "notes",
    ["scene", "builtin:bars", "--out", "o.wav", "--notes", "VALUE"],
    ["", " ", "H4", "C", "C4 X", "c4", "C44", "C4 " * 65],
    "note",
)
for name, text in hostile_yaml().items():
    hostile(f"scene of {name}", PLAY, files={"s.yaml": text})
each(
    "out",
    ["scene", "s.yaml", "--out", "VALUE"],
    "o.mp3 o '' . nowhere/o.wav s.yaml",
    files={"s.yaml": scene()},
)
for option, wrong in (
    ("video", "o.avi"),
    ("page", "o.txt"),
    ("gltf", "o.obj"),
    ("impacts", "o.txt"),
):
    hostile(
        f"{option} of a wrong ending",
        f"{PLAY} --{option} {wrong}",
        wrong,
        files={"s.yaml": scene()},
    )
hostile(
    "two outputs of one name",
    "scene s.yaml --out o.wav --page o.html --impacts o.html",
    files={"s.yaml": scene()},
)

for what, keys in {
    "an unknown key": {"colours": "red"},
    "no gravity": {"gravity": "[0, 0]"},
    "gravity without end": {"gravity": "[0, 0, .inf]"},
    "a negative length": {"seconds": "-1"},
    "a length that nobody hears": {"seconds": "1e9"},
    "an unknown ground": {"ground_material": "cheese"},
    "a path that goes back": {"listener": "{path: [[1, 0, 0, 0], [0, 0, 0, 0]]}"},
    "two places of a head": {"listener": "{path: [[0, 0, 0, 0]], position: [0, 0, 0]}"},
    "a step of no length": {"engine": "{steps: 1}"},
    "no sampling rate": {"sound": "{rate: 0}"},
    "an unknown word": {"sound": "{full_scale: loud}"},
}.items():
    hostile(f"scene of {what}", PLAY, files={"s.yaml": scene(**keys)})

for what, keys, says in (
    ("an unknown material", {"material": "steal"}, "did you mean steel"),
    ("no material", {"material": ""}, "material"),
    ("nothing to be", {"radius": ""}, "radius"),
    ("two things to be", {"mesh": "builtin:bar"}, "radius"),
    ("no mass", {"density": "0"}, "density"),
    ("hardly a mass", {"radius": "1e-4", "density": "0.001"}, "mass"),
    ("a negative radius", {"radius": "-1"}, "radius"),
    ("a place of no number", {"position": "[0, 0, .nan]"}, "finite"),
    ("a bounce that gains", {"restitution": "1.5"}, "restitution"),
    ("a pitch of nothing that sounds", {"pitch": "440"}, "pitch"),
    ("a name that cannot be printed", {"name": '"\\x07"'}, "name"),
    ("an object below the ground", {"position": "[0, 0, -1]"}, "overlap"),
    ("an object that touches nothing", {"position": "[0, 0, 5]"}, "nothing touches"),
    ("a ball of regions", {"regions": "[{name: a}]"}, "regions goes with mesh"),
    ("a ball that is held", {"supports": "[{where: x < 0}]"}, "supports goes with mesh"),
):
    hostile(f"object with {what}", PLAY, says, files={"s.yaml": scene(ball(**keys))})
for what, keys, says in (
    ("no such design", {"design": "nowhere.h5"}, "nowhere.h5"),
    ("modes in place of a design", {"design": "m.h5"}, "modes"),
    ("a design in place of modes", {"modes": "d.h5"}, "design"),
    ("text in place of a design", {"design": "s.yaml"}, "s.yaml"),
    ("no such mesh", {"mesh": "nowhere.obj", "material": "steel"}, "nowhere.obj"),
    ("no such built-in mesh", {"mesh": "builtin:moon", "material": "steel"}, "moon"),
    ("a density of a design", {"design": "d.h5", "density": "1000"}, "density"),
    ("places in modes", {"modes": "m.h5", "regions": "[{name: a, where: x < 0}]"}, "tells where"),
    ("regions not in modes", {"modes": "m.h5", "regions": "[{name: a}]"}, "has no region 'a'"),
    (
        "a region of code",
        {
            "mesh": "builtin:bar",
            "regions": "[{name: a, material: iron, where: __import__('os') < 1}]",
        },
        "where a number belongs",
    ),
    (
        "holes",
        {"mesh": "builtin:bar", "regions": "[{name: a, material: iron, where: x < 0}]"},
        "are of no region",
    ),
    (
        "no such material",
        {"mesh": "builtin:bar", "regions": "[{name: a, material: irn}]"},
        "did you mean iron",
    ),
    (
        "what is held and moves",
        {"mesh": "builtin:bar", "material": "steel", "supports": "[{where: x < 0}]"},
        "fixed: true",
    ),
    (
        "nothing to hold",
        {
            "mesh": "builtin:bar",
            "material": "steel",
            "fixed": "true",
            "supports": "[{where: x > 9}]",
        },
        "meets nothing",
    ),
):
    nothing = {"radius": "", "count": "", "material": ""}
    files = {"s.yaml": scene(ball(**nothing | keys)), "m.h5": MODES, "d.h5": DESIGN}
    hostile(f"object of {what}", PLAY, says, files=files)
hostile(
    "two objects of one name",
    PLAY,
    "line 4: objects[1].name",
    files={"s.yaml": scene(ball(), ball())},
)
hostile(
    "two objects in each other",
    PLAY,
    "overlap",
    files={"s.yaml": scene(ball(position="[0, 0, 1]"), ball(name="c", position="[0, 0, 1.005]"))},
)
hostile(
    "a thousand objects and one",
    PLAY,
    "objects",
    files={"s.yaml": scene(*(ball(name=f"n{number}") for number in range(1001)))},
)
hostile(
    "a million contacts",
    PLAY,
    "contacts",
    files={
        "s.yaml": scene(
            *(
                ball(
                    name=f"n{i}",
                    position=f"[{0.021 * (i % 10)}, {0.021 * (i // 10)}, 0.01]",
                    velocity="[1, 0, 0]",
                )
                for i in range(12)
            ),
            seconds="1",
            engine="{steps: 200, contact_seconds: 0.0001}",
        )
    },
    usual=False,
)
hostile("no room for the sound", PLAY, files={"s.yaml": scene()}, file_size=4096)
control("a ball that falls", PLAY, "o.wav", files={"s.yaml": scene()})
control(
    "a ball that falls, for programs",
    "scene s.yaml --out o.wav --impacts i.csv --json",
    "o.wav",
    "i.csv",
    files={"s.yaml": scene()},
)
