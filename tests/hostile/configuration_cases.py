"""Rows of configurations, checked as the Snakefile checks them before any rule."""

from tests.hostile.cases import Table
from tests.hostile.zoo import CONFIGURATION

TABLE = Table("tests.hostile.configure")
MESH = "'builtin:bar'"
TOP = "dataset: {"
"""Before which a key of the first level can stand."""


def hostile(name: str, old: str, new: str, *says: str) -> None:
    """A row with a configuration in whose text something is replaced.

    Names are tried with every change, as is every second one of all else.
    """
    assert old in CONFIGURATION, old
    files = {"c.yaml": CONFIGURATION.replace(old, new)}
    usual = old == MESH or len(TABLE.rows) % 2 == 0
    TABLE.hostile(name, "c.yaml", *says, files=files, usual=usual)


def control(name: str, old: str, new: str, **files: str) -> None:
    """A row with a configuration that is valid."""
    assert old in CONFIGURATION, old
    TABLE.control(name, "c.yaml", files={"c.yaml": CONFIGURATION.replace(old, new), **files})


# Names that reach a shell, a file or a pattern of Snakemake ---------------------------------------

for name, mesh in {
    "a command": "builtin:bar$(touch x)",
    "a command in backticks": "builtin:bar`touch x`",
    "two commands": "builtin:bar; touch x",
    "a redirection": "builtin:bar > x",
    "an unknown object": "builtin:bra",
    "a blank": "builtin:bar ",
    "nothing": "",
    "nothing built in": "builtin:",
    "a missing file": "nowhere.obj",
    "a folder": "/",
    "a device": "/dev/null",
    "a long name": "x" * 300 + ".obj",
    "a pipe": "ZOO/odd/pipe.obj",
    "a line break": "builtin:bar\ntouch x",
}.items():
    quoted = '"' + mesh.replace("\n", "\\n") + '"'
    hostile(f"mesh with {name}", MESH, quoted, "mesh" if name != "nothing" else "")
hostile("mesh with NUL", MESH, '"a\\0b.obj"')
hostile("mesh that is a number", MESH, "5", "mesh")
hostile("mesh that is a list", MESH, "[a]", "mesh")
for name, folder in {
    "nothing": "",
    "NUL": "a\\0b",
    "a long name": "x" * 300,
    "a line break": "a\\nb",
    "a folder of the system": "/proc/results",
    "a device": "/dev/null",
}.items():
    hostile(f"results in {name}", TOP, f'results_dir: "{folder}"\n{TOP}', "results_dir")
for name, material in {
    "a command": "$(touch x)",
    "an unknown name": "steel",
    "a missing file": "nowhere.npy",
    "nothing": "",
    "NUL": "a\\0b.npy",
    "a folder": "/",
}.items():
    hostile(f"material with {name}", "two-region", f'"{material}"')
for name, model in {
    "a command": '"$(touch x)"',
    "a slash": "../bar",
    "umlauts": "bär",
}.items():
    hostile(f"model called {name}", "{bar:", "{" + f"{model}:")
hostile("no launcher", "solver: {", "solver: {launcher: '', ", "launcher")

# Numbers ------------------------------------------------------------------------------------------

for value in ("0", "1", "1.5", "nan", "null", "'20'", "2020-01-01", "1000000", "[20]", "-20"):
    hostile(f"resolution {value}", "resolution: 20", f"resolution: {value}", "resolution")
for key, values in {
    "unit": ("0", "-1", ".nan", ".inf", "1e300", "1e-300", "ell"),
    "density": ("0", "-1", ".nan", "1e300", "1e-300"),
    "seed": ("-1", "1.5", str(2**64), "nan"),
    "modes": ("11", "0", "1.5", str(2**64), "true"),
    "strike": ("[0, 0]", "[.nan, 0, 0]", "[.inf, 0, 0]", "[a, b, c]", "0"),
    "fill": ("best", "null", "1"),
    "components": ("all", "[]"),
    "title": ("5", "[a]"),
}.items():
    for value in values:
        hostile(f"model's {key} {value}", "resolution: 20", f"resolution: 20, {key}: {value}", key)
for key, values in {
    "samples": ("0", "-1", "99", "1.5", ".nan", str(10**30)),
    "shards": ("0", "-1", "1e3", str(2**64), "100000000"),
    "seed": ("-1", str(2**64)),
    "workers": ("0", "1000000", str(2**64)),
    "distributions": ("[]", "[normal]", "[uniform, uniform]", "uniform"),
    "ranges": (
        "{uniform: [5, 1]}",
        "{uniform: [.nan, 1]}",
        "{uniform: [0, .inf]}",
        "{normal: [0, 1]}",
    ),
    "objective": ("best", "null"),
}.items():
    for value in values:
        text = "dataset: {" + f"{key}: {value}"
        text += "" if key == "samples" else ", samples: 600"
        whole = "dataset: {samples: 600, distributions: [uniform], shards: 2}"
        hostile(f"dataset's {key} {value}", whole, text + "}", key)
for key, values in {
    "trees": ("0", "1.5", "10000000000"),
    "depth": ("0", "10000000000"),
    "max_leaves": ("0", "1e10", "10000000000"),
    "min_leaf": ("0", str(2**64)),
    "ranks": ("0", "1000000"),
    "blocks": ("0", str(2**64)),
    "materials": ("1", "13"),
    "model": ("nowhere.h5", "''", '"a\\0b"', "5"),
}.items():
    for value in values:
        hostile(
            f"forests' {key} {value}",
            "forests: {trees: 1, depth: 6}",
            "forests: {" + f"{key}: {value}" + "}",
            key,
        )
for key, values in {
    "modes": ("11", ".nan", str(2**64)),
    "tolerance": ("0", "1", ".nan", "-1"),
    "corrections": ("0", str(2**64)),
    "ranks": ("0", "1000000", str(2**64)),
    "cores": ("0", "1.5"),
    "interface": ("loose",),
    "retained_modes": ("5",),
    "subdomains": ("0", "1e300"),
}.items():
    for value in values:
        hostile(
            f"solver's {key} {value}",
            "solver: {modes: 12, cores: 1}",
            "solver: {" + f"{key}: {value}" + "}",
            key,
        )
for key, text in {
    "poisson": "poisson: 0.5",
    "poisson nan": "poisson: .nan",
    "times of no model": "times: {models: [bell]}",
    "convergence of no model": "convergence: {models: [bell]}",
    "scaling of no model": "scaling: {models: [bell]}",
    "objectives": "objectives: {objectives: [best]}",
    "mass_damping": "validation: {mass_damping: .nan}",
    "tolerances": "validation: {tolerances: {residual: .nan}}",
    "contact": "validation: {contact: 1e300}",
    "an unknown key": "modles: {}",
    "a key that is a number": "5: 6",
    "baseline": 'baseline: "a\\0b"',
    "mesh_folder": 'mesh_folder: "a\\0b"',
}.items():
    hostile(key, TOP, f"{text}\n{TOP}")
hostile("no models", "models:", "modles:")
hostile("models that are none", "models: {bar: {", "models: {}\nmodle: {bar: {", "")

control("the configuration", MESH, MESH)
control("a mesh with blanks and quotes", MESH, '"ZOO/my box.obj"')
control("results with blanks", TOP, f'results_dir: "my; results"\n{TOP}')
control("a title of odd characters", TOP, f'title: "$(touch x) {{a}} <b> 箱"\n{TOP}')
