"""Rows of `python -m solver`."""

from tests.hostile import zoo_growing
from tests.hostile.cases import CLOSED, NO_NUMBERS, NO_WHOLE_NUMBERS, Copy, Place, Table, unreadable
from tests.hostile.zoo_meshes import VALID_NAMES

TABLE = Table("solver")
hostile, control, each = TABLE.hostile, TABLE.control, TABLE.each

PLAIN = "modes builtin:box --resolution 4 --modes 12"
BOX = f"{PLAIN} --method slepc"
OUT = "--out out.h5"
MODES = f"{BOX} {OUT}"
SCALING = "scaling builtin:box --resolution 4 --modes 12 --ranks"
TIMED = "benchmark builtin:box --resolution 4"

# The command line ---------------------------------------------------------------------------------

hostile("nothing at all", "", "command")
hostile("no such command", "mode", "mode")
hostile("no such command, megabytes", ["x" * 100_000])
hostile("no such option", f"{MODES} --fast", "--fast")
hostile("option cut short to several", f"{MODES} --in mumps")
hostile("no mesh", "modes --resolution 4 --out out.h5", "mesh")
hostile("no resolution", f"modes builtin:box {OUT}", "--resolution", "--accuracy")
hostile("no out", BOX, "--out")
hostile("a line break in an option", [*BOX.split(), "--out", "out.h5", "--fa\nst"])
hostile("an escape sequence in an option", [*BOX.split(), "--out", "out.h5", "--\x1b[2Jfast"])
hostile("bytes that are no text", [*BOX.split(), "--out", "out.h5", "--fast\udcff"])

# Numbers ------------------------------------------------------------------------------------------

each(
    "resolution",
    "modes builtin:box --resolution VALUE --out out.h5",
    "NO_WHOLE_NUMBERS -1 0 1 10**30 9223372036854775807 1000000",
    "resolution",
)
each(
    "modes",
    "modes builtin:box --resolution 4 --modes VALUE --out out.h5",
    "NO_WHOLE_NUMBERS -1 0 6 10**30 9223372036854775807 10000",
    "modes",
)
each("seed", f"{MODES} --seed VALUE", [*NO_WHOLE_NUMBERS, "-1", str(2**64), str(10**30)], "seed")
each("unit", f"{MODES} --unit VALUE", [*NO_NUMBERS, "0", "-1", "1e300", "1e-300"], "unit")
each("density", f"{MODES} --density VALUE", [*NO_NUMBERS, "0", "-1", "1e300", "1e-300"], "density")
each(
    "Poisson's ratio",
    f"{MODES} --poisson VALUE",
    "NO_NUMBERS 0.5 -1 1e300 0.49999999999999999",
    "poisson",
)
each("tolerance", f"{MODES} --tol VALUE", [*NO_NUMBERS, "-1"], "--tol")
each("cutoff", f"{PLAIN} --cutoff VALUE --out out.h5", "NO_NUMBERS 0 -1 1e300 1e-300", "cutoff")
each(
    "corrections",
    f"{PLAIN} --corrections VALUE --out out.h5",
    "-1 1.5 2**63 10**30",
    "--corrections",
)
each("keep", f"{MODES} --retained-modes VALUE", ["0", "-1", "nan", str(2**63)], "--retained-modes")
each("subdomains", f"{MODES} --subdomains VALUE", ["0", "-1", "nan", str(2**63)], "--subdomains")
each("ranks", f"{SCALING} VALUE", "0 -1 '' 1, 1,a 1000000 1,1000000 2**63 '1;2' 1.5", "ranks")
each("latency", f"{SCALING} 1 --latency VALUE", "0 -1 nan inf", "--latency")
each("bandwidth", f"{SCALING} 1 --bandwidth VALUE", "0 -1 nan inf", "--bandwidth")
each("runs", f"{TIMED} --modes 12 --runs VALUE", ["0", "-1", "1e3"])
each("slow runs", f"{TIMED} --modes 12 --runs 1 --slow-runs VALUE", "0 nan", "--slow-runs")
each("modes timed", f"{TIMED} --modes VALUE --runs 1", "0 -5 6 2**64 1e2", "modes")
each(
    "modes compared", "objectives builtin:box --resolution 4 --modes VALUE", "0 -5 6 2**64", "modes"
)
each(
    "modes rated",
    "coarsening builtin:box --resolution 4 --modes VALUE",
    "0 -5 6 61 2**64 1e1",
    "modes",
)
each("sizes compared", "accuracy --solids sphere --levels VALUE", "0 1 5 2**64 1e0", "levels")
each("solids compared", "accuracy --solids VALUE", "'' cube block, block,,plate ../block", "solids")
each(
    "accuracy",
    f"{PLAIN} --accuracy VALUE --out out.h5",
    "NO_NUMBERS 0 -0.1 1.1 1e-300",
    "--accuracy",
)
hostile("accuracy without an estimate", f"{MODES} --accuracy 0.1 --no-estimate", "--no-estimate")
hostile("estimate of a value", f"{MODES} --estimate=0.1", "--estimate")
each(
    "error of modes refined to",
    f"{MODES} --coarsen average --refine-to VALUE",
    "'' -0.1 nan inf 11 much",
    "--refine-to",
)
hostile("voxels that are refined", f"{MODES} --refine-to 0.1", "--refine-to", "--coarsen")
hostile("voxels that are refined to nothing", f"{MODES} --refine-to 0", "--refine-to", "--coarsen")
each(
    "error refined to",
    "coarsening builtin:box --resolution 4 --refine-to VALUE",
    "0 -0.1 nan inf",
    "--refine-to",
)
each(
    "rounds of all ways",
    "discretisation builtin:box --resolution 4 --runs VALUE",
    "0 -1 1e3",
    "--runs",
)
each(
    "modes followed",
    "convergence builtin:box --resolution 4 --modes VALUE --out out.json",
    "0 -5 6 2**64",
    "modes",
)
each(
    "steps",
    "convergence builtin:box --resolution 4 --modes 12 --out out.json --steps VALUE",
    "-1 nan 10**30",
    "--steps",
)
# Choices ------------------------------------------------------------------------------------------

for option in (
    "method",
    "coarsen",
    "objective",
    "fill",
    "components",
    "interface",
    "linear-solver",
):
    hostile(f"no such {option}", f"{MODES} --{option} best", option, "best")
hostile("no such acceleration", f"{MODES} --acceleration ''", "acceleration")
hostile("no such objective to rate", "objectives builtin:box --resolution 4 --objectives a,b", "a")
hostile(
    "no objectives to rate", "objectives builtin:box --resolution 4 --objectives ,", "objective"
)
hostile("PETSc option without prefix", [*MODES.split(), "--petsc", "-eps_ncv 400"], "prefix")
hostile("PETSc option of another prefix", [*MODES.split(), "--petsc", "-carillon_x 1 -log_view"])
hostile("PETSc option unknown", [*MODES.split(), "--petsc", "-carillon_eps_nonsense 3"])
hostile(
    "PETSc option refused by PETSc", [*MODES.split(), "--petsc", "-carillon_eps_ncv abc"], "petsc"
)
hostile("PETSc option negative", [*MODES.split(), "--petsc", "-carillon_eps_ncv -5"])
hostile(
    "PETSc type unknown", [*MODES.split(), "--petsc", "-carillon_st_pc_type nonsense"], "nonsense"
)
hostile("PETSc solver unknown", [*MODES.split(), "--petsc", "-carillon_eps_type nonsense"])
hostile("PETSc quote unclosed", [*MODES.split(), "--petsc", "-carillon_eps_ncv '4"])
hostile("PETSc nothing", [*MODES.split(), "--petsc", "words"])

# Meshes -------------------------------------------------------------------------------------------

MESH = "modes VALUE --resolution 8 --modes 12 --method slepc --out out.h5"
each("mesh", MESH, ["builtin:", "builtin:nothing", "builtin:box ", "builtin:$(touch x)"], "builtin")
each("mesh", MESH, ["", ".", "nowhere.obj", "/", "box.obj/", "~root/x.obj"])
each("mesh of a long name", MESH, ["x" * 300 + ".obj", "y/" * 3000 + "box.obj"])
each(
    "mesh broken",
    MESH,
    (
        "ZOO/empty.obj ZOO/empty.stl ZOO/empty.ply ZOO/empty.glb ZOO/empty.off ZOO/empty.gltf "
        "ZOO/{empty,junk}.{msh,vtu,vtk,inp,med,mesh} "
        "ZOO/empty.3mf ZOO/junk.obj ZOO/junk.stl ZOO/junk.ply ZOO/junk.glb ZOO/junk.off "
        "ZOO/junk.gltf ZOO/junk.3mf ZOO/cut.stl ZOO/cut.ply ZOO/cut.glb ZOO/claims.stl "
        "ZOO/claims.ply ZOO/claims.off ZOO/claims.glb ZOO/{foreign,relative}.gltf ZOO/box.xyzzy "
        "ZOO/box ZOO/{words,range,below,index,points,nan,inf,beyond,latin,nul}.obj"
    ),
)
each(
    "mesh that grows",
    MESH,
    (
        "ZOO/grows-{zeros,sparse,instances,chain,circle,rows}.glb ZOO/grows-buffer.gltf "
        "ZOO/grows-parts.3mf ZOO/grows-text.3mf ZOO/grows-{points,blocks}.vtu ZOO/grows-image.vtk "
        "ZOO/grows-nodes.msh ZOO/grows-parts.dae"
    ),
)
each(
    "mesh absurd",
    MESH,
    "ZOO/{flat,line,point,triangle,degenerate,huge,largest,tiny,far,needle,apart}.obj",
)
CELLS = "--resolution 8 --modes 12 --discretisation finite-cell --out out.h5"
hostile("cells of a sheet", f"modes ZOO/triangle.obj {CELLS}", "encloses nothing")
hostile("cells of a needle", f"modes ZOO/needle.obj {CELLS}", "thinner", "resolution to")
hostile("cells that are apart", f"modes ZOO/apart.obj {CELLS}", "pieces", "--components")
hostile("cells of no thickness", f"modes ZOO/flat.obj {CELLS}", "is flat")
hostile(
    "cells with another lattice's moduli",
    f"modes ZOO/inside-out.obj {CELLS} --material ZOO/good.npy",
    "good.npy",
)
hostile("cells that are coarsened", f"modes builtin:box {CELLS} --coarsen average", "is for voxels")
hostile(
    "cells among objectives", "objectives builtin:box --resolution 4 --discretisation finite-cell"
)
each("mesh that is", MESH, "ZOO/odd/{folder,pipe,socket,link,dangling,null,zero,full}.obj")
hostile("mesh that is a WAV file", "modes ZOO/metal.wav --resolution 8 --out out.h5", "metal.wav")
hostile("mesh that is HDF5", "modes ZOO/modes.h5 --resolution 8 --out out.h5", "modes.h5")
hostile(
    "mesh that may not be read",
    "modes box.obj --resolution 8 --out out.h5",
    "permission",
    **unreadable("box.obj", "box.obj"),
)
hostile("mesh with a leading dash", "modes -box.obj --resolution 8 --out out.h5")
hostile(
    "mesh scaled to nothing", f"modes ZOO/box.obj --resolution 4 --modes 12 --unit 1e-200 {OUT}"
)
hostile("mesh finer than memory", f"modes builtin:box --resolution 20000 {OUT}", "20,000")

# Materials ----------------------------------------------------------------------------------------

MATERIAL = f"{MODES} --material VALUE"
each("material", MATERIAL, ["", "steel", "uniform ", "Uniform", "$(touch x)", "/"], "material")
each("material of a long name", MATERIAL, ["x" * 300 + ".npy"])
each(
    "material",
    MATERIAL,
    [
        f"ZOO/{name}.npy"
        for name in (
            *("complex", "bool", "datetime", "duration", "text", "bytes", "structured", "object"),
            *("short", "long", "none", "scalar", "negative", "nan", "inf", "zero", "zeros"),
            *("huge", "tiny", "contrast", "denormal", "archive", "cut", "head", "empty", "junk"),
            *("version", "claims", "square", "below", "code"),
        )
    ],
)
each(
    "material",
    MATERIAL,
    [
        f"ZOO/{name}.txt"
        for name in (
            *("words", "complex", "true", "short", "ragged", "nan", "empty", "comments"),
            *("semicolons", "commas", "digits", "underscores", "hexadecimal", "beyond"),
            *("latin", "nul"),
        )
    ],
)
each(
    "material that is",
    MATERIAL,
    (
        "ZOO/odd/{folder,pipe,socket,link,zero,null}.npy ZOO/odd/{pipe,zero}.txt ZOO/modes.h5 "
        "ZOO/metal.wav"
    ),
)
hostile(
    "material that may not be read",
    f"{MODES} --material young.npy",
    "permission",
    **unreadable("young.npy", "good.npy"),
)

# Outputs ------------------------------------------------------------------------------------------

OUTPUT = f"{BOX} --out VALUE"
each("out", OUTPUT, ["", ".", "/", "nowhere/out.h5", "/proc/out.h5", "out.h5/", "a" * 300 + ".h5"])
hostile("out that is a folder", MODES, "folder", files={"out.h5": Place("folder")})
for kind in ("null", "full", "pipe", "socket"):
    hostile(f"out that is {kind}", MODES, "out.h5", files={"out.h5": Place(kind)})
hostile("out that links to nowhere", MODES, files={"out.h5": Place("link", "x/y")})
hostile("out that links to itself", MODES, files={"out.h5": Place("link", "out.h5")})
hostile(
    "out that is the mesh",
    "modes box.obj --resolution 4 --modes 12 --out box.obj",
    files={"box.obj": Copy("box.obj")},
)
hostile(
    "out that is the material",
    f"{BOX} --material good.npy --out good.npy",
    files={"good.npy": Copy("good.npy")},
)
hostile(
    "out that is the start",
    f"{BOX} --initial-modes modes.h5 --out ./modes.h5",
    files={"modes.h5": Copy("modes.h5")},
)
hostile(
    "out that is the forests",
    f"{BOX} --coarsen ddfem --forest f.h5 --out f.h5",
    files={"f.h5": Copy("forests.h5")},
)
hostile("out in a closed folder", f"{BOX} --out closed/out.h5", "closed/out.h5", **CLOSED)
hostile("out on a full disk", MODES, "make room", file_size=2000)
hostile("out on a disk full at once", MODES, "make room", file_size=0)
for value in ("0", "nan", "2"):
    hostile(f"audit to a tolerance of {value}", f"audit ZOO/modes.h5 --tolerance {value}")
hostile("audit into a folder", "audit ZOO/modes.h5 --out audits", files={"audits": Place("folder")})
hostile("audit onto its input", "audit m.h5 --out m.h5", files={"m.h5": Copy("modes.h5")})
hostile("audit onto a device", "audit ZOO/modes.h5 --out null", files={"null": Place("null")})
hostile("audit on a full disk", "audit ZOO/modes.h5 --out a.json", "make room", file_size=100)
hostile("benchmark into nowhere", f"{TIMED} --out nowhere/row.json")
hostile("objectives into nowhere", "objectives builtin:box --resolution 4 --out nowhere/o.json")
hostile("distance of nothing", "distance nowhere.stl", "nowhere.stl")
hostile(
    "distance by a coarse reference",
    "distance builtin:box --resolution 12 --reference 12",
    "--reference 12",
)
hostile("accuracy into nowhere", "accuracy --solids sphere --out nowhere/a.json")
hostile("rating into nowhere", "coarsening builtin:box --resolution 4 --out nowhere/case.json")
hostile("pictures into nowhere", "coarsening builtin:box --resolution 4 --pictures nowhere/case.h5")
hostile("ways into nowhere", "discretisation builtin:box --resolution 4 --out nowhere/case.json")
hostile("nothing coarsened", "coarsening builtin:box --resolution 4 --coarsen none", "none")
hostile("scaling into nowhere", "scaling builtin:box --resolution 4 --out nowhere/s.json")
hostile("plot of no format", "scaling builtin:box --resolution 4 --plot scaling.mp3", "scaling.mp3")
hostile("plot into nowhere", "scaling builtin:box --resolution 4 --plot nowhere/scaling.png")
hostile("convergence into nowhere", "convergence builtin:box --resolution 4 --out nowhere/c.json")

# Files that it reads ------------------------------------------------------------------------------

DAMAGES = (
    *("cut", "flipped", "unsealed", "longer", "missing", "words", "complex", "scalar", "shape"),
    *("nothing", "group", "nan", "claims", "link", "outside", "virtual", "loop", "kind"),
    *("schema", "no-kind", "odd-schema", "eigenvalues-nan", "eigenvalues-inf", "young-nan"),
    *("young-negative", "cells-beyond", "cells-below"),
)
NO_MODES = (
    *("ZOO/shard.h5", "ZOO/forests.h5", "ZOO/design.h5", "ZOO/empty.h5", "ZOO/text.h5"),
    *("ZOO/signature.h5", "ZOO/foreign.h5", "ZOO/metal.wav", "nowhere.h5", "", "."),
    *("ZOO/odd/folder.h5", "ZOO/odd/pipe.h5", "ZOO/odd/zero.h5", "ZOO/odd/link.h5"),
)
each("audit of", "audit VALUE", [f"ZOO/modes-{damage}.h5" for damage in DAMAGES])
each("audit of", "audit VALUE", NO_MODES)
each("audit of", "audit VALUE", [f"ZOO/{name}" for name in zoo_growing.FILES])
each(
    "modes for ParaView of",
    "vtu VALUE --out m.vtu",
    [f"ZOO/modes-{damage}.h5" for damage in DAMAGES],
)
each("modes for ParaView of", "vtu VALUE --out m.vtu", NO_MODES)
hostile("modes for ParaView by another name", "vtu ZOO/modes.h5 --out m.vtk", ".vtu")
hostile("motion without a mode", "vtu ZOO/modes.h5 --out m.pvd", "expected .vtu")
for value in ("0", "-1", "1e3", "999999", "x"):
    hostile(f"motion of mode {value}", f"vtu ZOO/modes.h5 --mode {value} --out m.pvd", "mode")
for value in ("1", "-24", "1000000", "nan"):
    words = f"vtu ZOO/modes.h5 --mode 7 --frames {value} --out m.pvd"
    hostile(f"motion in {value} frames", words, "frames")
for value in ("0", "-1", "inf", "nan"):
    words = f"vtu ZOO/modes.h5 --mode 7 --amplitude {value} --out m.pvd"
    hostile(f"motion by {value}", words, "amplitude")
hostile(
    "modes for ParaView on a full disk", "vtu ZOO/modes.h5 --out m.vtu", "make room", file_size=100
)
hostile("matrices of nothing", "matrices builtin:box --resolution 4", "expected --stiffness")
# Modes are not read.
each(
    "matrices of",
    "matrices VALUE --mass M.mtx",
    [f"ZOO/modes-{damage}.h5" for damage in DAMAGES if damage != "nan"],
)
hostile(
    "matrices of a mesh without resolution", "matrices ZOO/box.stl --mass M.mtx", "--resolution"
)
hostile("matrices by another name", "matrices ZOO/modes.h5 --mass M.csv", ".mtx")
hostile(
    "matrices onto each other", "matrices ZOO/modes.h5 --mass M.mtx --stiffness ./M.mtx", "differ"
)
for ending in ("mtx", "petsc", "npz"):
    words = f"matrices ZOO/modes.h5 --mass M.{ending}"
    hostile(f"matrices on a full disk, {ending}", words, "make room", file_size=100)
hostile("matrices onto their input", "matrices m.h5 --nodes m.h5", files={"m.h5": Copy("modes.h5")})
hostile("audit of a long name", ["audit", "x" * 300 + ".h5"])
hostile("audit of a good and a bad one", "audit ZOO/modes.h5 ZOO/modes-cut.h5", "modes-cut.h5")
control(
    "audit of two of one name", "audit ZOO/modes.h5 modes.h5", files={"modes.h5": Copy("modes.h5")}
)
each(
    "comparison of",
    "compare VALUE ZOO/modes.h5",
    "ZOO/modes-{nan,eigenvalues-nan,cut,shape,claims}.h5 ZOO/{design,bar}.h5 nowhere.h5",
)
hostile("comparison with another solid", "compare ZOO/modes.h5 ZOO/bar.h5")
hostile("comparison with nothing", "compare ZOO/modes.h5", "truth")
each(
    "response of",
    "respond VALUE --out out.h5",
    "ZOO/modes-{nan,eigenvalues-nan,flipped,unsealed}.h5 ZOO/shard.h5 nowhere.h5",
)
hostile("response of another solid", "respond ZOO/modes.h5 ZOO/bar.h5 --out out.h5")
hostile(
    "response called truth",
    "respond ZOO/modes.h5 truth.h5 --out out.h5",
    "truth",
    files={"truth.h5": Copy("random.h5")},
)
hostile(
    "response of two of one name",
    "respond ZOO/modes.h5 a/m.h5 b/m.h5 --out out.h5",
    files={"a/m.h5": Copy("random.h5"), "b/m.h5": Copy("modes.h5")},
)
hostile("response onto its input", "respond m.h5 --out m.h5", files={"m.h5": Copy("modes.h5")})
hostile("response on a full disk", "respond ZOO/modes.h5 --out out.h5", "make room", file_size=3000)
for option in ("strike", "observed"):
    for point in ("nan nan nan", "inf 0 0", "1e300 0 0", "5 5 5", "a b c", "1 2"):
        hostile(
            f"{option} at {point}", f"respond ZOO/modes.h5 --out out.h5 --{option} {point}", option
        )
for option in ("mass-damping", "stiffness-damping", "contact", "periods"):
    for value in ("nan", "-1", "inf", ""):
        hostile(
            f"{option} {value!r}",
            ["respond", "ZOO/modes.h5", "--out", "out.h5", f"--{option}", value],
            option,
        )
hostile("contact of an hour", "respond ZOO/modes.h5 --out out.h5 --contact 1e300", "contact")
hostile("periods without end", "respond ZOO/modes.h5 --out out.h5 --periods 1e300", "periods")
each(
    "start from",
    f"{MODES} --initial-modes VALUE",
    "ZOO/modes-{nan,cut,shape}.h5 ZOO/{bar,shard}.h5 nowhere.h5 ZOO/odd/pipe.h5",
)
each(
    "truth that is",
    "convergence builtin:box --resolution 4 --modes 12 --out c.json --truth VALUE",
    "ZOO/{modes-eigenvalues-nan,modes-cut,bar}.h5 nowhere.h5",
)
each(
    "forests that are",
    f"{MODES} --coarsen ddfem --forest VALUE",
    (
        "ZOO/forests-{cut,flipped,unsealed,missing,words,complex,shape,claims,kind,schema}.h5 "
        "ZOO/{modes,text}.h5 nowhere.h5 '' ZOO/odd/pipe.h5"
    ),
)
hostile("forests of another ratio", f"{MODES} --coarsen ddfem --poisson -0.3", "-0.3")

# Honest failures ----------------------------------------------------------------------------------

hostile(
    "too few corrections",
    "modes builtin:box --resolution 6 --modes 40 --corrections 1 --tol 1e-15 --out out.h5",
    status=3,
)
hostile("tolerance below rounding", f"{MODES} --tol 1e-300", "--tol")

# Controls -----------------------------------------------------------------------------------------

control("the box", MODES, "out.h5")
control("component modes", f"{PLAIN} --out out.h5", "out.h5")
control(
    "a mesh file by forests",
    "modes ZOO/box.obj --resolution 8 --modes 12 --coarsen ddfem --out out.h5",
    "out.h5",
)
for name in VALID_NAMES[1:]:
    control(
        f"a mesh called {name!r}",
        [
            "modes",
            f"ZOO/{name}",
            "--resolution",
            "4",
            "--modes",
            "12",
            "--method",
            "slepc",
            "--out",
            "out.h5",
        ],
        "out.h5",
    )
for end in ("stl", "ply", "glb", "off"):
    control(
        f"a mesh as {end}",
        f"modes ZOO/box.{end} --resolution 4 --modes 12 --method slepc {OUT}",
        "out.h5",
    )
for name in ("twice", "inside-out"):
    control(
        f"a mesh {name}",
        f"modes ZOO/{name}.obj --resolution 4 --modes 12 --method slepc {OUT}",
        "out.h5",
    )
for name in ("good.npy", "whole.npy", "single.npy", "swapped.npy", "good.txt"):
    control(f"moduli of {name}", f"{MODES} --material ZOO/{name}", "out.h5")
control(
    "an out with blanks and quotes", [*BOX.split(), "--out", "m o'd{e}s \".h5"], "m o'd{e}s \".h5"
)
control(
    "a start",
    f"modes builtin:box --resolution 4 --modes 10 --material random "
    f"--initial-modes ZOO/modes.h5 {OUT}",
    "out.h5",
)
control("PETSc options", [*MODES.split(), "--petsc", "-carillon_eps_ncv 40"], "out.h5")
control("modes for ParaView", "vtu ZOO/modes.h5 --out m.vtu", "m.vtu")
control("matrices", "matrices ZOO/modes.h5 --stiffness K.mtx --mass M.petsc", "K.mtx", "M.petsc")
control("audit", "audit ZOO/modes.h5 ZOO/random.h5 --out audit.json", "audit.json")
control("comparison", "compare ZOO/modes.h5 ZOO/random.h5")
control(
    "response", "respond ZOO/modes.h5 ZOO/random.h5 --out out.h5 --strike 0.1 0.075 0.1", "out.h5"
)
control("convergence", "convergence builtin:box --resolution 4 --modes 12 --out c.json", "c.json")
