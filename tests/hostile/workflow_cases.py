"""Rows of `python -m workflow`."""

import json

from tests.hostile.cases import CLOSED, NO_NUMBERS, NO_WHOLE_NUMBERS, Place, Table
from tests.hostile.places import KINDS
from tests.hostile.zoo import CONFIGURATION
from tests.hostile.zoo_texts import hostile_yaml

TABLE = Table("workflow")
hostile, control, each = TABLE.hostile, TABLE.control, TABLE.each

hostile("nothing at all", "", "command")
hostile("no such command", "run", "run")

# estimate -----------------------------------------------------------------------------------------

each(
    "configuration",
    "estimate --configfile VALUE",
    (
        "ZOO/config-{twice,bomb,nested,long,nul,latin,tag,second,cut}.yaml ZOO/metal.wav "
        "ZOO/modes.h5 ZOO/box.obj ZOO/project.yaml nowhere.yaml '' . LONG.yaml ZOO/odd/{folder,"
        "pipe,zero,link,null,socket}.yaml"
    ),
)
for name, content in hostile_yaml().items():
    hostile(f"configuration: {name}", "estimate --configfile c.yaml", files={"c.yaml": content})
each("nodes", "estimate --preset tiny --nodes VALUE", [*NO_WHOLE_NUMBERS, "0", "-1"], "--nodes")
each("cores", "estimate --preset tiny --cores-per-node VALUE", "0 -1 nan 2**64", "--cores-per-node")
hostile("no such preset", "estimate --preset gigantic", "gigantic")
hostile("preset and file", "estimate --preset tiny --configfile ZOO/config.yaml", "--configfile")
hostile("no such objective", "estimate --preset tiny --objective best", "best")
each(
    "results of a run",
    "estimate --preset tiny --results VALUE",
    "nowhere ZOO/metal.wav ZOO/odd ZOO ''",
)
hostile(
    "results without benchmarks",
    "estimate --preset tiny --results .",
    "benchmark",
    files={"config.yaml": CONFIGURATION},
)

# compare ------------------------------------------------------------------------------------------

TABLE_FILE = json.dumps(
    {
        "name": "spectra",
        "caption": "Spectra.",
        "columns": [
            {"key": "model", "label": "Model", "kind": "text", "unit": "", "shown": True},
            {"key": "error", "label": "Error", "kind": "percent", "unit": "1", "shown": True},
        ],
        "rows": [{"model": "bar", "error": 0.5}],
        "keys": ["model"],
        "conditions": None,
    }
)
GOOD = {"a/tables/spectra.json": TABLE_FILE, "b/tables/spectra.json": TABLE_FILE}
each(
    "folder",
    "compare VALUE b",
    "nowhere '' . ZOO b/tables/spectra.json LONG ZOO/odd/pipe.h5 /dev/null",
    files=GOOD,
)
for name, text in {
    "empty": "",
    "a list": "[]",
    "words": "words",
    "cut": TABLE_FILE[:-40],
    "deep": "[" * 100_000,
    "rows that are words": TABLE_FILE.replace('"rows": [', '"rows": ["x",'),
    "no columns": TABLE_FILE.replace("columns", "pillars"),
    "null": "null",
    "number": "1",
    "columns that are none": TABLE_FILE.replace('"kind": "text"', '"colour": "red"'),
    "bytes": "\x00\x01\x02",
}.items():
    hostile(
        f"table: {name}",
        "compare a b",
        "spectra.json",
        files={**GOOD, "a/tables/spectra.json": text},
    )
hostile(
    "table of bytes that are no text",
    "compare a b",
    files={**GOOD, "a/tables/spectra.json": b"\xff\xfe\xff" * 100},
)
hostile("table that is a pipe", "compare a b", files={**GOOD, "a/tables/more.json": Place("pipe")})
hostile(
    "table as CSV without head",
    "compare c b",
    "spectra.csv",
    files={**GOOD, "c/tables/spectra.csv": "a,b\n1,2,3\n"},
)
hostile(
    "nothing in common",
    "compare a c",
    files={**GOOD, "c/tables/other.json": TABLE_FILE.replace("spectra", "other")},
)
hostile(
    "configuration that is broken",
    "compare a b",
    "config.yaml",
    files={**GOOD, "a/config.yaml": "[" * 5000},
)
hostile(
    "configuration that multiplies",
    "compare a b",
    "config.yaml",
    files={**GOOD, "a/config.yaml": "a: &a [1]\nb: [*a]\n"},
)
hostile("out that is a file", "compare a b --out o", files={**GOOD, "o": "text"})
hostile("out below a file", "compare a b --out o/p", files={**GOOD, "o": "text"})
hostile("out in /proc", "compare a b --out /proc/o", files=GOOD)
hostile("out that is one of both", "compare a b --out a/tables", files=GOOD)

# digest -------------------------------------------------------------------------------------------

each(
    "digest",
    "digest VALUE",
    (
        "nowhere.h5 '' ZOO/{text,empty}.h5 ZOO/metal.wav ZOO/{shard-cut,shard-flipped,modes-claims,"
        "modes-link,modes-outside,modes-virtual,modes-unsealed}.h5 ZOO/odd/{pipe,zero,folder,"
        "link}.h5 LONG /dev/null"
    ),
)
hostile("digest of nothing", "digest", "paths")

# crate --------------------------------------------------------------------------------------------

RUN = {"r/config.yaml": CONFIGURATION, "r/a.json": "{}"}
each(
    "crate", "crate VALUE", "nowhere '' . ZOO ZOO/metal.wav ZOO/odd ZOO/odd/pipe.h5 LONG /dev/null"
)
each(
    "crate's file",
    "crate r --out VALUE",
    "'' . r o.tar /dev/null no/o.zip r/a.json LONG.zip",
    files=RUN,
)
each("crate's licence", "crate r --licence VALUE", "'' 'my own' ../../x", "--licence", files=RUN)
each("crate's creator", "crate r --creator VALUE", "'' ' '", "--creator", files=RUN)
each("left out", "crate r --leave-out VALUE", "'' . .. /etc nothing LONG", "--leave-out", files=RUN)
for kind in KINDS[1:]:
    odd = {"r/odd.txt": Place(kind, "a.json")}
    hostile(f"crate of a {kind}", "crate r", "r/odd.txt", files={**RUN, **odd})
hostile("crate of what is no HDF5", "crate r", "r/cut.h5", files={**RUN, "r/cut.h5": "text"})
for name, content in hostile_yaml().items():
    hostile(f"crate of {name}", "crate r", files={**RUN, "r/config.yaml": content})
control("crate", "crate r --out o.zip", "o.zip", files=RUN)

# validate -----------------------------------------------------------------------------------------

VALIDATE = "validate builtin:box --resolution 4 --modes 12 --cores 1 --out o"
for option, values in {
    "resolution": (*NO_WHOLE_NUMBERS, "0", "1000000", str(2**64)),
    "modes": ("0", "11", "nan", str(2**64), "100000"),
    "unit": (*NO_NUMBERS, "0", "-1", "1e300", "1e-300"),
    "density": (*NO_NUMBERS, "0", "1e300", "1e-300"),
    "poisson": ("nan", "0.5", "-1"),
    "seed": ("-1", "1.5", str(2**64)),
    "cores": ("0", "nan", "-1"),
    "ranks": ("0", "1.5", "5000"),
    "tolerance": ("0", "nan", "0.5"),
    "mass-damping": ("nan", "-1", "1e300"),
    "stiffness-damping": ("nan", "-1"),
    "fill": ("best",),
    "components": ("all",),
    "material": ("steel", "", "ZOO/complex.npy", "ZOO/nan.npy", "ZOO/claims.npy"),
    "forest": ("nowhere.h5", "ZOO/modes.h5", ""),
    "tolerances": (
        "best=1",
        "residual",
        "residual=",
        "residual=nan",
        "residual=-1",
        "=1",
        "residual=1e400",
    ),
    "strike": ("nan nan nan", "5 5 5", "1 2", "1e300 0 0"),
    "observed": ("nan nan nan", "inf 0 0"),
}.items():
    for value in values:
        words = value.split(" ") if option in ("strike", "observed") else [value]
        hostile(
            f"{option} {value if len(value) < 40 else value[:20]!r}",
            [*VALIDATE.split(), f"--{option}", *words],
        )
each(
    "validate",
    "validate VALUE --resolution 4 --cores 1 --out o",
    (
        "nowhere.obj builtin:nothing ZOO/{nan,flat}.obj ZOO/odd/{pipe,folder}.obj '' ZOO/huge.obj "
        "ZOO/metal.wav"
    ),
)
hostile("validate into a file", VALIDATE, "o", files={"o": "text"})
hostile("validate into a device", VALIDATE, "o", files={"o": Place("null")})
hostile("validate below a file", f"{VALIDATE}/p", files={"o": "text"})
hostile("validate into /proc", VALIDATE.replace("--out o", "--out /proc/o"))
hostile("validate into a long name", VALIDATE.replace("--out o", "--out " + "x" * 300))
hostile(
    "validate into a closed folder", f"{VALIDATE.replace('--out o', '--out closed/o')}", **CLOSED
)

# recordings ---------------------------------------------------------------------------------------

each(
    "out",
    "recordings --out VALUE",
    "ZOO/modes.h5 ZOO/odd/pipe.h5 /proc/o /dev/null LONG ZOO/modes.h5/o",
)
hostile("recordings without a place", "recordings", "--out")

control("estimate", "estimate --preset tiny")
control("estimate of a file", "estimate --configfile ZOO/config.yaml --json")
control("estimate of a file marked", "estimate --configfile ZOO/config-marked.yaml")
control("compare", "compare a b --json", files=GOOD)
control("digest", "digest ZOO/shard.h5 ZOO/modes.h5 ZOO/design.h5 ZOO/forests.h5")
control(
    "an odd name",
    ["estimate", "--configfile", "a b {c};'.yaml"],
    files={"a b {c};'.yaml": CONFIGURATION},
)
