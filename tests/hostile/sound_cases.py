"""Rows of `python -m sound`."""

from tests.hostile.cases import CLOSED, NO_NUMBERS, NO_WHOLE_NUMBERS, Copy, Place, Table, unreadable
from tests.hostile.zoo import PROJECT
from tests.hostile.zoo_texts import hostile_yaml

TABLE = Table("sound")
hostile, control, each, places = TABLE.hostile, TABLE.control, TABLE.each, TABLE.places

# The command line ---------------------------------------------------------------------------------

hostile("nothing at all", "", "command")
hostile("no such command", "play", "play")
hostile("no such option", "clip metal --out o.wav --loud", "--loud")
hostile("no clip", "extract", "clip")
hostile("no out", "clip metal", "--out")
hostile("no such instrument", "clip glass --out o.wav", "glass")
hostile("bytes that are no text", ["clip", "metal\udcff", "--out", "o.wav"])

# extract ------------------------------------------------------------------------------------------

each(
    "clip",
    "extract VALUE --out o.json --residual r.wav",
    (
        "ZOO/{silence,none,one,brief,constant,clipped,nan,inf,huge,large,all-huge,tiny,slow,head,"
        "empty,junk,riff,text,rate-zero,rate-huge,no-channels,many-channels,claims,noise}.wav "
        "ZOO/modes.h5 ZOO/box.obj ZOO/project.yaml nowhere.wav '' . / ZOO/odd/{folder,pipe,socket,"
        "link,dangling,null,zero,full}.wav"
    ),
)
hostile("clip of a long name", ["extract", "x" * 300 + ".wav"])
hostile("clip called like an option", "extract -- -x.wav", "-x.wav")
hostile("a good clip and a bad one", "extract ZOO/metal.wav ZOO/nan.wav", "nan.wav")
hostile(
    "clip that may not be read",
    "extract clip.wav",
    "permission",
    **unreadable("clip.wav", "metal.wav"),
)
each("modes", "extract ZOO/metal.wav --modes VALUE", [*NO_WHOLE_NUMBERS, "0", "-1"], "--modes")
hostile("residual of two", "extract ZOO/metal.wav ZOO/wood.wav --residual r.wav", "--residual")
each("out", "extract ZOO/metal.wav --out VALUE", ". nowhere/o.json /proc/o.json LONG o.json/")
places("out that is", "extract ZOO/metal.wav --out o.json", "o.json")
places("residual that is", "extract ZOO/metal.wav --residual r.wav", "r.wav")
hostile("residual as MP3", "extract ZOO/metal.wav --residual r.mp3", "r.mp3")
hostile(
    "residual that is the clip",
    "extract c.wav --residual c.wav",
    files={"c.wav": Copy("metal.wav")},
)
hostile("out that is the clip", "extract c.wav --out c.wav", files={"c.wav": Copy("metal.wav")})
hostile("out that is the residual", "extract ZOO/metal.wav --out o.wav --residual ./o.wav")
hostile("out on a full disk", "extract ZOO/metal.wav --out o.json", "make room", file_size=10)
hostile(
    "residual on a full disk", "extract ZOO/metal.wav --residual r.wav", "make room", file_size=1000
)

# clip ---------------------------------------------------------------------------------------------

each(
    "seconds",
    "clip metal --seconds VALUE --out o.wav",
    "NO_NUMBERS 0 -1 1e300 1e-300 61",
    "seconds",
)
each(
    "rate",
    "clip metal --rate VALUE --out o.wav",
    "NO_WHOLE_NUMBERS 0 -1 999 100000000000 2**64",
    "rate",
)
each("seed", "clip metal --seed VALUE --out o.wav", ["-1", "nan", str(2**64), "1.5"], "seed")
each("pitch", "clip metal --pitch VALUE --out o.wav", "NO_NUMBERS 0 -1 1e300 1e-300 1e9", "pitch")
each(
    "note",
    "clip metal --note VALUE --out o.wav",
    ["", "H4", "C", "C99", "C-99", "C4; ls", "c##4", "４", "C" + "9" * 400],
    "note",
)
hostile("note and pitch", "clip metal --note C4 --pitch 200 --out o.wav", "--pitch")
each(
    "clip to",
    "clip metal --seconds 0.3 --out VALUE",
    "o.mp3 o.flac o '' . nowhere/o.wav /proc/o.wav LONG.wav o.wav/",
)
places("clip to", "clip metal --seconds 0.3 --out o.wav", "o.wav")
hostile("clip on a full disk", "clip metal --seconds 0.3 --out o.wav", "make room", file_size=1000)
hostile(
    "clip on a disk full at once", "clip metal --seconds 0.3 --out o.wav", "make room", file_size=0
)
hostile("clip into a closed folder", "clip metal --seconds 0.3 --out closed/o.wav", **CLOSED)

# heads --------------------------------------------------------------------------------------------

each(
    "folder of heads",
    "heads VALUE",
    "nowhere '' . ZOO/metal.wav ZOO/odd/{pipe,null,dangling}.wav LONG",
)
hostile("a head that is none", "heads heads", "a.sofa", files={"heads/a.sofa": Copy("modes.h5")})
hostile("a head of text", "heads heads", "a.sofa", files={"heads/a.sofa": "no numbers"})
hostile("a head that is a pipe", "heads heads", "a.sofa", files={"heads/a.sofa": Place("pipe")})

# init ---------------------------------------------------------------------------------------------

INIT = "init p.yaml --mesh builtin:bar"
hostile("init without a mesh", "init p.yaml", "--mesh")
each(
    "init of mesh",
    "init p.yaml --mesh VALUE",
    (
        "builtin:bra builtin: nowhere.obj ZOO/nan.obj ZOO/metal.wav '' . ZOO/odd/{pipe,folder}.obj "
        "LONG.obj"
    ),
)
each(
    "init of clip",
    f"{INIT} --clips VALUE",
    "nowhere.wav ZOO/{nan,silence,noise}.wav ZOO/box.obj '' .",
)
hostile("init of no clip", f"{INIT} --clips", "--clips")
hostile("init of a name that is not printed", f"{INIT} --clips 'a\tb.wav'")
each(
    "init to",
    "init VALUE --mesh builtin:bar",
    "p.txt nowhere/p.yaml /proc/p.yaml /proc/p /proc LONG.yaml LONG",
)
for kind in ("null", "full", "pipe", "socket", "link"):
    hostile(f"init to {kind}", INIT, "there already", files={"p.yaml": Place(kind, "nowhere")})
hostile("init onto a project", INIT, "there already", files={"p.yaml": PROJECT})
hostile("init into a folder with a project", "init --mesh builtin:bar", files={"project.yaml": ""})
hostile("init on a full disk", INIT, "make room", file_size=100)

# design: the project ------------------------------------------------------------------------------

DESIGN = "design p.yaml --evaluations 1 --out d.h5"


def project(old: str, new: str, whole: str = PROJECT) -> dict[str, str]:
    """A project in whose text something is replaced."""
    assert old in whole
    whole = whole.replace("metal.wav", "ZOO/metal.wav").replace("wood.wav", "ZOO/wood.wav")
    return {"p.yaml": whole.replace(old.replace("metal.wav", "ZOO/metal.wav"), new)}


for number, (name, content) in enumerate(hostile_yaml().items()):
    usual = number % 3 == 0  # workflow estimate is tried with all of them
    hostile(f"project: {name}", DESIGN, "p.yaml", files={"p.yaml": content}, usual=usual)
each(
    "project",
    "design VALUE --out d.h5",
    (
        "ZOO/project-{twice,bomb,nested,long,nul,latin,tag,second,cut}.yaml ZOO/metal.wav "
        "ZOO/modes.h5 ZOO/box.obj ZOO/config.yaml nowhere.yaml '' . ZOO/odd/{folder,pipe,zero,link,"
        "null}.yaml"
    ),
)
CHANGES = {
    "no targets": ("targets:", "target:"),
    "no modes": ("modes: 6", "modes: 0"),
    "modes beyond 64 bits": ("modes: 6", f"modes: {10**30}"),
    "more modes than the clips have": ("modes: 6", "modes: 5000"),
    "modes that are true": ("modes: 6", "modes: true"),
    "modes that are a date": ("modes: 6", "modes: 2020-01-01"),
    "resolution 0": ("resolution: 16", "resolution: 0"),
    "resolution 1.5": ("resolution: 16", "resolution: 1.5"),
    "resolution nan": ("resolution: 16", "resolution: .nan"),
    "resolution of thirty digits": ("resolution: 16", f"resolution: {10**30}"),
    "resolution in octal": ("resolution: 16", "resolution: 0o20"),
    "unit nan": ("resolution: 16", "unit: .nan"),
    "unit 0": ("resolution: 16", "unit: 0"),
    "unit infinite": ("resolution: 16", "unit: .inf"),
    "density 1e-300": ("resolution: 16", "density: 1e-300"),
    "density negative": ("resolution: 16", "density: -1"),
    "modulus 1e-300": ("material: {dimensions: 10}", "material: {young: 1e-300}"),
    "modulus 0": ("material: {dimensions: 10}", "material: {young: 0}"),
    "one dimension": ("dimensions: 10", "dimensions: 1"),
    "no such law": ("dimensions: 10", "law: cubic"),
    "a weight negative": ("resolution: 16", "weights: {frequency: -1}"),
    "a mesh that is missing": ("builtin:bar", "nowhere.obj"),
    "a mesh unknown": ("builtin:bar", "builtin:bra"),
    "a mesh that is a folder": ("builtin:bar", "."),
    "a mesh that is nothing": ("builtin:bar", "''"),
    "a mesh with NUL": ("builtin:bar", '"a\\0b.obj"'),
    "a mesh of a long name": ("builtin:bar", "x" * 300 + ".obj"),
    "a mesh of NaN": ("builtin:bar", "ZOO/nan.obj"),
    "a clip of NaN": ("metal.wav", "ZOO/nan.wav"),
    "a clip that is huge": ("metal.wav", "ZOO/huge.wav"),
    "a clip that is a mesh": ("metal.wav", "ZOO/box.obj"),
    "a clip that is a pipe": ("metal.wav", "ZOO/odd/pipe.wav"),
    "a clip that is a folder": ("metal.wav", "ZOO/odd/folder.wav"),
    "a target without name": ("name: end", "name: ''"),
    "a target that is a number": ("name: end", "name: 5"),
    "a target at nan": ("-0.12, 0.0, 0.03", ".nan, 0, 0"),
    "a target at 1e300": ("-0.12, 0.0, 0.03", "1e300, 0, 0"),
    "two targets at one place": ("-0.12, 0.0, 0.03", "0.04, 0.0225, 0.02"),
    "a vertex that is not there": ("at: [-0.12, 0.0, 0.03]", "vertex: 1000000"),
    "a vertex below 0": ("at: [-0.12, 0.0, 0.03]", "vertex: -1"),
    "seconds nan": ("seconds: null", "seconds: .nan"),
    "seconds infinite": ("seconds: null", "seconds: .inf"),
    "a seed below 0": ("seconds: null", "seed: -1"),
    "a population of 1": ("seconds: null", "population: 1"),
    "no workers": ("workers: 1", "workers: 0"),
    "a place inside": ("resolution: 16", "resolution: 16\nlisten: {at: [0.1, 0, 0]}"),
    "a place of two numbers": ("resolution: 16", "resolution: 16\nlisten: {at: [1, 0]}"),
    "a place at nan": ("resolution: 16", "resolution: 16\nlisten: {at: [.nan, 0, 0]}"),
    "a place at 1e300": ("resolution: 16", "resolution: 16\nlisten: {at: [1e300, 0, 0]}"),
    "a place heard by rays": (
        "resolution: 16",
        "resolution: 16\nlisten: {at: [1, 0, 0], radiation: rays}",
    ),
    "no such method": ("seconds: null", "method: best"),
    "forests that are missing": ("coarsen: none", "coarsen: ddfem\nforest: nowhere.h5"),
    "forests that are modes": ("coarsen: none", "coarsen: ddfem\nforest: ZOO/modes.h5"),
    "forests with NUL": ("coarsen: none", 'coarsen: ddfem\nforest: "a\\0b"'),
}
for number, (name, (old, new)) in enumerate(CHANGES.items()):
    usual = number % 2 == 0 or any(word in name for word in ("NUL", "weights", "1e"))
    hostile(f"project with {name}", DESIGN, files=project(old, new), usual=usual)

# design: the command line and the file ------------------------------------------------------------

RUN = "design ZOO/project.yaml --evaluations 1 --out d.h5"
for option, values in {
    "seconds": ("nan", "inf", "0", "-1", ""),
    "evaluations": ("0", "-1", "nan", "1.5", str(2**64), ""),
    "workers": ("0", "-1", "1.5", "1000000", str(2**64)),
    "method": ("best", ""),
}.items():
    each(option, f"design ZOO/project.yaml --out d.h5 --{option} VALUE", values, option)
each(
    "design to",
    "design ZOO/project.yaml --evaluations 1 --out VALUE",
    ". '' nowhere/d.h5 /proc/d.h5 LONG d.h5/",
)
places("design to", RUN, "d.h5")
hostile(
    "design onto the project",
    "design p.yaml --evaluations 1 --out p.yaml",
    files=project("modes: 6", "modes: 5"),
)
for damage in ("cut", "flipped", "unsealed", "nan", "kind", "missing", "claims", "shape"):
    hostile(
        f"design goes on from one {damage}",
        RUN,
        "d.h5",
        files={"d.h5": Copy(f"design-{damage}.h5")},
    )
hostile("design goes on from modes", RUN, "d.h5", files={"d.h5": Copy("modes.h5")})
each(
    "design starts from",
    f"{RUN} --initial-design VALUE",
    "ZOO/{modes,design-cut}.h5 nowhere.h5 ZOO/odd/pipe.h5 '' ZOO/text.h5",
)
hostile("design on a full disk", RUN, "make room", file_size=1000)
each("benchmark's runs", "benchmark ZOO/project.yaml --runs VALUE", ["0", "-1", "1e3"], "--runs")
hostile("benchmark's seconds", "benchmark ZOO/project.yaml --seconds nan", "--seconds")
hostile("benchmark without project", "benchmark nowhere.yaml", "nowhere.yaml")

# render -------------------------------------------------------------------------------------------

RENDER = "render ZOO/design.h5 --target end --out o.wav"
each(
    "strike at",
    ["render", "ZOO/design.h5", "--out", "o.wav", "--at", "VALUE", "0", "0"],
    "nan inf 1e300 a '' 5",
)
each(
    "strike of modes at",
    ["render", "ZOO/modes.h5", "--out", "o.wav", "--at", "VALUE", "0", "0"],
    "nan inf 1e300 5",
)
each(
    "impulse",
    [*RENDER.split(), "--impulse", "VALUE", "0", "0"],
    "nan inf 0 1e300 1e-300 a",
    "impulse",
)
for option, values in {
    "strength": (*NO_NUMBERS, "0", "-1", "1e300", "1e-300"),
    "seconds": (*NO_NUMBERS, "0", "-1", "601", "1e300"),
    "rate": ("nan", "0", "999", "100000000000", str(2**64), "1e5"),
    "contact-seconds": ("nan", "-1", "inf", "1e300"),
}.items():
    each(option, f"{RENDER} --{option} VALUE", values, option)
each(
    "target",
    "render ZOO/design.h5 --out o.wav --target VALUE",
    ["", "middle", "end\n", "*"],
    "--target",
)
each(
    "vertex",
    "render ZOO/design.h5 --out o.wav --vertex VALUE",
    "-1 1.5 1000000 2**64 nan",
    "vertex",
)
hostile("nothing struck", "render ZOO/design.h5 --out o.wav", "--target")
hostile("two things struck", f"{RENDER} --vertex 3", "--vertex")
hostile("modes struck at a target", "render ZOO/modes.h5 --target end --out o.wav", "--at")
STRIKES = "render ZOO/design.h5 --strikes s.csv --out o.wav"
for name, text in {
    "nothing": "",
    "one word": "strike",
    "zeros": "\0" * 4096,
    "a long field": "time_seconds,target\n0," + "x" * 200_000 + "\n",
    "a long number": "time_seconds,vertex\n0," + "1" * 5000 + "\n",
    "an open quote": 'time_seconds,target\n0,"end\n',
    "a formula": "time_seconds,target\n=1+1,end\n",
    "another table": "a,b\n1,2\n",
    "infinite time": "time_seconds,target\ninf,end\n",
}.items():
    hostile(f"strikes of {name}", STRIKES, "s.csv", files={"s.csv": text})
for kind in ("folder", "pipe", "null"):
    hostile(f"strikes of a {kind}", STRIKES, "s.csv", files={"s.csv": Place(kind)})
hostile(
    "strikes that are the sound",
    "render ZOO/design.h5 --strikes s.wav --out s.wav",
    "input",
    files={"s.wav": "time_seconds,target\n0,end\n"},
)
hostile("modes alone over the sound", f"{RENDER} --modes-out o.wav", "--modes-out")
hostile("damping of a design", f"{RENDER} --damping 1 1", "--damping")
for value in ("nan 1", "-1 1", "inf 1", "1"):
    hostile(
        f"damping {value}",
        f"render ZOO/modes.h5 --at 0 0 0 --out o.wav --damping {value}",
        "--damping",
    )
each(
    "render",
    "render VALUE --target end --out o.wav",
    (
        "ZOO/design-{cut,flipped,unsealed,missing,words,complex,shape,group,nan,claims,link,"
        "outside,virtual,kind,schema,frequencies-nan,faces-below}.h5 ZOO/{shard,forests,text,"
        "empty}.h5 nowhere.h5 '' . ZOO/metal.wav ZOO/odd/{pipe,zero,folder}.h5"
    ),
)
each(
    "render modes of",
    "render VALUE --at 0.1 0.075 0.1 --out o.wav",
    "ZOO/modes-{cut,unsealed,nan,eigenvalues-nan,claims}.h5",
)
hostile("render like no design", "render ZOO/modes.h5 --at 0 0 0 --like ZOO/modes.h5 --out o.wav")
hostile(
    "render like another solid", "render ZOO/modes.h5 --target end --like ZOO/design.h5 --out o.wav"
)
each(
    "render to",
    "render ZOO/design.h5 --target end --out VALUE",
    "o.mp3 o . '' nowhere/o.wav /proc/o.wav LONG.wav",
)
places("render to", RENDER, "o.wav")
hostile(
    "render onto the design",
    "render d.wav --target end --out d.wav",
    files={"d.wav": Copy("design.h5")},
)
hostile("render on a full disk", RENDER, "make room", file_size=1000)

# export -------------------------------------------------------------------------------------------

for end in ("h5", "gltf", "glb", "dsp", "js", "json", "csv"):
    hostile(
        f"export {end} on a full disk",
        f"export ZOO/design.h5 --out o.{end}",
        "make room",
        file_size=200,
    )
    hostile(
        f"export {end} to a device",
        f"export ZOO/design.h5 --out o.{end}",
        files={f"o.{end}": Place("null")},
    )
each(
    "export to",
    "export ZOO/design.h5 --out VALUE",
    "o.obj o . '' nowhere/o.glb /proc/o.glb LONG.glb o.glb/",
)
each(
    "export of",
    "export VALUE --out o.glb",
    (
        "ZOO/{modes,design-cut,design-unsealed,design-nan,design-faces-below}.h5 nowhere.h5 "
        "ZOO/text.h5 ZOO/odd/pipe.h5 ''"
    ),
)
hostile("export onto the design", "export d.h5 --out ./d.h5", files={"d.h5": Copy("design.h5")})
hostile(
    "export onto the design by a link",
    "export d.h5 --out l.h5",
    files={"d.h5": Copy("design.h5"), "l.h5": Place("link", "d.h5")},
)
each(
    "points", "export ZOO/design.h5 --out o.dsp --points VALUE", "-1 1.5 2**64 1000000000", "points"
)
hostile(
    "export a folder on a full disk", "export ZOO/design.h5 --out o/", "make room", file_size=1000
)
hostile("export a folder to a file", "export ZOO/design.h5 --out o/", files={"o": Place("null")})
each("strengths", "export ZOO/design.h5 --out o/ --strengths VALUE", "0 -1 nan 1e9 x", "strengths")
each("variations", "export ZOO/design.h5 --out o/ --variations VALUE", "0 1.5 99", "variations")
each("up", "export ZOO/design.h5 --out o.glb --up VALUE", "w -z ''", "up")
hostile("no such format", "export ZOO/design.h5 --out o.glb --format obj", "--format")

# Controls -----------------------------------------------------------------------------------------

control("extract", "extract ZOO/metal.wav ZOO/wood.wav --out o.json", "o.json")
control("extract with its residual", "extract ZOO/tone.wav --modes 1 --residual r.wav", "r.wav")
control("extract from 24 bits", "extract ZOO/24-bit.wav")
control("extract from opposite channels", "extract ZOO/opposed.wav")
control("clip", "clip metal --seconds 0.3 --note F#3 --out o.wav", "o.wav")
control(
    "clip under an odd name",
    ["clip", "wood", "--seconds", "0.3", "--out", "{o} 'x'.wav"],
    "{o} 'x'.wav",
)
control("init", f"{INIT} --clips ZOO/metal.wav ZOO/wood.wav", "p.yaml")
control("init here", "init --mesh builtin:bell", "project.yaml")
control("init of a folder", "init p --mesh builtin:bell", "p", "p/project.yaml")
control("init of a folder by a slash", "init p.yaml/ --mesh builtin:bell", "p.yaml/project.yaml")
control("clip by a link", "clip metal --seconds 0.3 --out ./o.wav", "o.wav")
control(
    "project with a mark of its order of bytes",
    "design ZOO/project-marked.yaml --evaluations 1 --out d.h5",
    "d.h5",
)
control("render", RENDER, "o.wav")
control("strikes", STRIKES, "o.wav", files={"s.csv": "time_seconds,target\n0,end\n0.1,end\n"})
control("render modes", "render ZOO/modes.h5 --at 0.1 0.075 0.1 --seconds 0.1 --out o.wav", "o.wav")
for end in ("h5", "gltf", "glb", "dsp", "js", "json", "csv"):
    control(f"export {end}", f"export ZOO/design.h5 --out o.{end}", f"o.{end}")
