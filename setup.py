"""The wheel holds one package, `carillon`: the other rooms of the checkout lie in its `_rooms`."""

from setuptools import find_namespace_packages, setup

ROOMS = ("dataset_gen", "forests", "solver", "sound", "studio", "studies", "workflow")
INSTALLED = "carillon._rooms"
DATA = ("*.yaml", "*.json", "*.csv", "*.j2", "*.smk", "*.rst", "LICENSE")
PAGES = ("*.css", "*.html", "*.js", "*.svg")

rooms = [name for room in ROOMS for name in find_namespace_packages(include=[room, f"{room}.*"])]
setup(
    packages=[
        *find_namespace_packages(include=["carillon", "carillon.*"]),
        *(f"{INSTALLED}.{name}" for name in rooms),
    ],
    package_dir={f"{INSTALLED}.{room}": room for room in ROOMS},
    package_data={
        "": [*DATA, *PAGES],
        f"{INSTALLED}.forests": ["default.h5"],
        f"{INSTALLED}.workflow": ["Snakefile"],
    },
)
