"""The wheel holds one package, `carillon`: the other rooms of the checkout lie in its `_rooms`."""

import shutil
from pathlib import Path

from setuptools import find_namespace_packages, setup
from setuptools.command.build_py import build_py

ROOMS = ("dataset_gen", "forests", "solver", "sound", "studio", "studies", "workflow")
INSTALLED = "carillon._rooms"
DATA = ("*.yaml", "*.json", "*.csv", "*.j2", "*.smk", "*.rst", "LICENSE")
PAGES = ("*.css", "*.html", "*.js", "*.svg")


class BuildRooms(build_py):
    """Copies the modules as they are now, without tests and without what an earlier build left."""

    def run(self) -> None:
        shutil.rmtree(Path(self.build_lib) / "carillon", ignore_errors=True)
        super().run()
        # Crates of runs name the authors and the licence of the software.
        shutil.copy("CITATION.cff", Path(self.build_lib, *INSTALLED.split("."), "workflow"))

    def find_package_modules(self, package: str, package_dir: str) -> list[tuple[str, str, str]]:
        modules = super().find_package_modules(package, package_dir)
        return [found for found in modules if not found[1].startswith(("test_", "conftest"))]


rooms = [name for room in ROOMS for name in find_namespace_packages(include=[room, f"{room}.*"])]
setup(
    cmdclass={"build_py": BuildRooms},
    packages=[
        *find_namespace_packages(include=["carillon", "carillon.*"]),
        *(f"{INSTALLED}.{name}" for name in rooms),
    ],
    package_dir={f"{INSTALLED}.{room}": room for room in ROOMS},
    # What an sdist holds beside the packages is no part of the wheel.
    include_package_data=False,
    package_data={
        "": [*DATA, *PAGES],
        f"{INSTALLED}.forests": ["default.h5"],
        f"{INSTALLED}.workflow": ["Snakefile"],
    },
)
