"""Files of the present folder that Python and libraries would take for code or for settings.

People open folders of others'. Python puts the present folder first where it starts with `-c` or
`-m`, as it does for the processes of a pool; numba reads `.numba_config.yaml` there, whose cache
holds code, and matplotlib reads `matplotlibrc`. None of these counts here. PETSc's files are the
matter of `carillon.petsc`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, MutableMapping, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import ModuleType

_NUMBA = "numba.core.config"
READERS = (_NUMBA, "matplotlib")
"""Modules that read settings in the present folder when they are loaded."""

_ROOT = Path(__file__).resolve().parent.parent
_ELSEWHERE = "/"


def ignore_settings() -> None:
    """Have modules that are loaded later read no settings in the present folder."""
    if not any(isinstance(finder, _Elsewhere) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Elsewhere())


def ignore_modules(environment: MutableMapping[str, str], path: Sequence[str]) -> None:
    """Have Python, where it is started from here, import nothing from the present folder.

    Parameters
    ----------
    path
        Where this process looks for modules. Where the first is the folder of Carillon itself, as
        in its checkout, processes that are started from here look there, too.

    Examples
    --------
    >>> environment = {}
    >>> ignore_modules(environment, ["/somewhere", "/else"])
    >>> environment
    {'PYTHONSAFEPATH': '1'}
    """
    if not environment.get("PYTHONSAFEPATH") and path and Path(path[0] or ".").resolve() == _ROOT:
        others = environment.get("PYTHONPATH")
        environment["PYTHONPATH"] = os.pathsep.join([str(_ROOT), *([others] if others else [])])
    environment["PYTHONSAFEPATH"] = "1"


class _Elsewhere(MetaPathFinder):
    """Finds the readers, as others do, and has them loaded in another folder."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name not in READERS:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _LoaderElsewhere(spec.loader.name, spec.loader.path)
        return spec


class _LoaderElsewhere(SourceFileLoader):
    def exec_module(self, module: ModuleType) -> None:
        with _elsewhere():
            super().exec_module(module)
        if module.__name__ == _NUMBA:  # which looks again whenever it compiles
            module.__dict__["_config_fname"] = os.devnull


@contextmanager
def _elsewhere() -> Iterator[None]:
    """Another present folder, of all threads, while a module is loaded."""
    here = os.open(".", os.O_PATH | os.O_DIRECTORY)
    try:
        os.chdir(_ELSEWHERE)
        yield
    finally:
        os.fchdir(here)
        os.close(here)
