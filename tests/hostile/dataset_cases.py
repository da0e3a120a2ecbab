"""Rows of `python -m dataset_gen`."""

from tests.hostile.cases import CLOSED, NO_NUMBERS, Copy, Place, Table, unreadable

TABLE = Table("dataset_gen")
hostile, control, each, places = TABLE.hostile, TABLE.control, TABLE.each, TABLE.places

MAKE = "generate --samples 200 --out s.h5"

hostile("nothing at all", "", "command")
hostile("no such command", "make", "make")
hostile("no samples", "generate --out s.h5", "--samples")
hostile("no out", "generate --samples 200", "--out")
hostile("no such option", f"{MAKE} --fast", "--fast")
each(
    "samples",
    "generate --samples VALUE --out s.h5",
    "NO_WHOLE_NUMBERS 0 -1 2**63 10**30",
    "--samples",
)
each("seed", f"{MAKE} --seed VALUE", ["-1", "nan", str(2**63), str(2**64), str(10**30)], "seed")
each("shards", f"{MAKE} --shards VALUE", ["0", "-1", "nan", "201", str(2**64)])
each("shard", f"{MAKE} --shards 2 --shard VALUE", ["2", "-1", "nan", str(2**64)], "shard")
each("workers", f"{MAKE} --workers VALUE", ["0", "-1", "1.5", "1000000", str(2**64)], "workers")
each("poisson", f"{MAKE} --poisson VALUE", [*NO_NUMBERS, "0.5", "-1", "1e300"], "poisson")
each("low", f"{MAKE} --low VALUE", [*NO_NUMBERS, "-1", "1e300", "11"])
each("high", f"{MAKE} --high VALUE", [*NO_NUMBERS, "0", "-1", "1e300", "1e-300"])
hostile("low above high", f"{MAKE} --low 5 --high 1")
hostile("low equal to high", f"{MAKE} --low 5 --high 5")
hostile("low 0 of logarithms", f"{MAKE} --distribution log-uniform --low 0")
hostile("no such objective", f"{MAKE} --objective best", "best")
hostile("no such distribution", f"{MAKE} --distribution normal", "normal")
hostile("more samples than any disk holds", "generate --samples 9000000000000000000 --out s.h5")
each(
    "out",
    "generate --samples 200 --out VALUE",
    ["nowhere/s.h5", "", "/", "/proc/s.h5", ".", "x" * 300, "x" * 250, "s.h5/"],
)
places("out that is", MAKE, "s.h5", "s.h5")
hostile("out that links to itself", MAKE, files={"s.h5": Place("link", "s.h5")})
hostile("out in a closed folder", "generate --samples 200 --out closed/s.h5", "closed", **CLOSED)
hostile("out that is other work", MAKE, "s.h5", files={"s.h5": Copy("other.h5")})
hostile("out that is modes", MAKE, "s.h5", files={"s.h5": Copy("modes.h5")})
hostile("out that is words", MAKE, "s.h5", files={"s.h5": "my thesis\n"})
hostile("out that is damaged", MAKE, "s.h5", files={"s.h5": Copy("shard-cut.h5")})
hostile("a journal of junk", MAKE, "journal", files={".s.h5.journal": b"\xff" * 1000})
hostile("a journal that is a folder", MAKE, "journal", files={".s.h5.journal": Place("folder")})
hostile("a journal that is a pipe", MAKE, "journal", files={".s.h5.journal": Place("pipe")})
hostile(
    "a journal of a later version",
    MAKE,
    "journal",
    files={".s.h5.journal": "Carillon journal of a shard, 9\n" + "x" * 100},
)
hostile("benchmark of nothing", "benchmark --samples 0", "--samples")
hostile("benchmark of no objective", "benchmark --objective best", "best")
hostile("benchmark beyond 64 bits", f"benchmark --samples {10**30}", "--samples")
hostile("benchmark beyond memory", "benchmark --samples 9000000000000000000")
hostile("inspect nothing", "inspect", "file")
each(
    "inspect",
    "inspect VALUE",
    (
        "ZOO/shard-{cut,flipped,unsealed,longer,missing,words,complex,scalar,shape,nothing,group,"
        "nan,claims,link,outside,virtual,loop,kind,schema,no-kind,odd-schema}.h5 ZOO/{modes,"
        "forests,design,empty,text,signature,foreign}.h5 ZOO/metal.wav nowhere.h5 '' . LONG "
        "ZOO/odd/{folder,pipe,zero,null,link,dangling,socket}.h5"
    ),
)
hostile(
    "inspect what may not be read", "inspect s.h5", "permission", **unreadable("s.h5", "shard.h5")
)

control("generate", MAKE, "s.h5")
control(
    "generate under an odd name",
    ["generate", "--samples", "50", "--out", "a b;{c}'.h5"],
    "a b;{c}'.h5",
)
control("generate what is there", MAKE, "s.h5", files={"s.h5": Copy("shard.h5")})
control("inspect", "inspect ZOO/shard.h5 --json")
