"""Rows of `python -m forests`."""

from tests.hostile.cases import CLOSED, NO_NUMBERS, NO_WHOLE_NUMBERS, Copy, Place, Table

TABLE = Table("forests")
hostile, control, each, places = TABLE.hostile, TABLE.control, TABLE.each, TABLE.places

TRAIN = "train ZOO/shard.h5 --trees 1 --depth 3 --out f.h5"
GROW = "grow ZOO/shard.h5 --trees 1 --depth 3 --tree 0 --out t.h5"

hostile("nothing at all", "", "command")
hostile("no such command", "plant", "plant")
hostile("no shards", "train --out f.h5", "neither shards nor --samples")
hostile("shards and samples", "train ZOO/shard.h5 --samples 1e3 --out f.h5", "one of both")
each(
    "samples",
    "train --samples VALUE --out f.h5",
    (*(text for text in NO_WHOLE_NUMBERS if text != "1e3"), "0", "-1", "1e30", "1.5e0"),
    "samples",
)
hostile("no out", "train ZOO/shard.h5", "--out")
for option, values in {
    "trees": (*NO_WHOLE_NUMBERS, "0", "-1", "10000000000", str(10**30)),
    "depth": ("0", "-1", "nan", "10000000000", str(10**30)),
    "max-leaves": ("0", "-1", "1e10", "10000000000", str(2**64)),
    "min-leaf": ("0", "nan", str(2**64)),
    "structure-rows": ("0", "1e6", str(2**64)),
    "seed": ("-1", "1.5", str(2**64), str(10**30)),
    "workers": ("0", "-1", "1000000", str(2**64)),
    "prior": (*NO_NUMBERS, "0", "-1", "1e300"),
    "uniform-weight": ("nan", "0", "inf", "1e300"),
}.items():
    each(option, f"train ZOO/shard.h5 --out f.h5 --{option} VALUE", values, option)
hostile("no such transform", f"{TRAIN} --transform square", "square")
hostile("no such grower", f"{TRAIN} --grower gardener", "gardener")
hostile("leaves larger than the data", f"{TRAIN} --min-leaf 1000000000")
each(
    "train on",
    "train VALUE --trees 1 --depth 3 --out f.h5",
    (
        "ZOO/shard-{cut,flipped,unsealed,missing,words,complex,shape,nothing,group,nan,claims,link,"
        "outside,virtual,kind,schema}.h5 ZOO/{modes,forests,tree0,text,empty}.h5 nowhere.h5 '' . "
        "LONG ZOO/odd/{pipe,zero,folder,link}.h5"
    ),
)
hostile(
    "train on a good and a bad one", "train ZOO/half.h5 ZOO/shard-cut.h5 --out f.h5", "shard-cut.h5"
)
hostile("train on one twice", "train ZOO/shard.h5 ZOO/shard.h5 --out f.h5", "shard.h5")
hostile("train on overlapping ones", "train ZOO/shard.h5 ZOO/half.h5 --out f.h5")
hostile("train on two ratios", "train ZOO/shard.h5 ZOO/other.h5 --out f.h5", "other.h5")
each(
    "train to",
    "train ZOO/shard.h5 --trees 1 --depth 3 --out VALUE",
    ". '' nowhere/f.h5 /proc/f.h5 LONG f.h5/",
)
places("train to", TRAIN, "f.h5", "f.h5")
hostile(
    "train onto a shard",
    "train s.h5 --trees 1 --depth 3 --out s.h5",
    files={"s.h5": Copy("shard.h5")},
)
hostile("train on a full disk", TRAIN, "make room", file_size=1000)
hostile("train on a disk full at once", TRAIN, "make room", file_size=0)
hostile("train into a closed folder", "train ZOO/shard.h5 --out closed/f.h5", "closed", **CLOSED)
STRUCTURE = f"{TRAIN} --structure VALUE ZOO/tree1.h5"
each(
    "structure",
    STRUCTURE,
    (
        "ZOO/tree0-{cut,flipped,unsealed,missing,words,complex,shape,nothing,nan,claims,kind,"
        "schema}.h5 ZOO/{tree1,shard}.h5 nowhere.h5 ZOO/odd/pipe.h5"
    ),
)
hostile("structure of too few", f"{TRAIN} --structure ZOO/tree0.h5")
hostile(
    "structure of another training",
    "train ZOO/shard.h5 --trees 1 --depth 4 --out f.h5 --structure ZOO/tree0.h5 ZOO/tree1.h5",
    "depth",
)
each(
    "tree",
    "grow ZOO/shard.h5 --trees 1 --depth 3 --out t.h5 --tree VALUE",
    "2 -1 nan '' 2**64",
    "tree",
)
hostile("grow to a device", GROW, files={"t.h5": Place("null")})
hostile("grow on a full disk", GROW, "make room", file_size=1000)

each(
    "inspect",
    "inspect VALUE",
    (
        "ZOO/forests-{cut,flipped,unsealed,longer,missing,words,complex,scalar,shape,nothing,group,"
        "nan,claims,link,outside,virtual,loop,kind,schema,no-kind,odd-schema}.h5 ZOO/{modes,shard,"
        "text,foreign}.h5 nowhere.h5 ZOO/odd/{pipe,zero,folder}.h5"
    ),
)
for option, values in {
    "blocks": ("0", "-1", "nan", str(2**64), "9000000000000000000"),
    "seed": ("-1", str(2**64)),
    "materials": ("1", "0", "nan", str(2**64), "1000000", "13"),
}.items():
    each(f"table's {option}", f"table --model ZOO/forests.h5 --{option} VALUE", values, option)
hostile("table of no model", "table --model nowhere.h5 --blocks 10", "nowhere.h5")
hostile("table of a shard", "table --model ZOO/shard.h5 --blocks 10", "shard.h5")
hostile("table plotted as MP3", "table --model ZOO/forests.h5 --blocks 10 --plot p.mp3", "p.mp3")
hostile("table plotted into nowhere", "table --model ZOO/forests.h5 --blocks 10 --plot no/p.png")
hostile("table into nowhere", "table --model ZOO/forests.h5 --blocks 10 --out no/t.json", "no/")
hostile(
    "table onto its model",
    "table --model f.h5 --blocks 10 --materials 2 --out ./f.h5",
    files={"f.h5": Copy("forests.h5")},
)
hostile(
    "table from no database",
    "table --model ZOO/forests.h5 --blocks 10 --database ZOO/modes.h5",
    "modes.h5",
)
hostile(
    "table from a database of text",
    "table --model ZOO/forests.h5 --blocks 10 --database ZOO/text.h5",
    "text.h5",
)
hostile(
    "table with its database nowhere",
    "table --model ZOO/forests.h5 --blocks 10 --materials 2 --database no/d.h5",
    "no/",
)
hostile("benchmark of no model", "benchmark --forest nowhere.h5", "nowhere.h5")
each(
    "benchmark's blocks",
    "benchmark --forest ZOO/forests.h5 --blocks VALUE",
    "0 nan 2**64 9000000000000000000",
    "blocks",
)
each(
    "benchmark's largest",
    "benchmark --forest ZOO/forests.h5 --blocks 10 --largest VALUE",
    "NO_NUMBERS 0 -1 1e300 1e9",
    "largest",
)
hostile("variants of none", "variants ZOO/shard.h5 --only nothing", "nothing")
hostile("variants into nowhere", "variants ZOO/shard.h5 --out no/v.json", "no/")
each(
    "curve over",
    "curve ZOO/shard.h5 --rows VALUE",
    "1e9 a 0 -5 nan '' 1e300 1,,2 '1e3;2e3' 10**30",
    "rows",
)
hostile("curve plotted as MP3", "curve ZOO/shard.h5 --rows 100 --plot c.mp3", "c.mp3")
hostile("curve of no shard", "curve nowhere.h5 --rows 100", "nowhere.h5")

control("train", TRAIN, "f.h5")
control("train on grown trees", f"{TRAIN} --structure ZOO/tree0.h5 ZOO/tree1.h5", "f.h5")
control("grow", GROW, "t.h5")
control("inspect", "inspect ZOO/forests.h5 --json")
control("inspect those of the package", "inspect")
