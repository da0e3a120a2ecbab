"""Files of the present folder that Python and libraries would take for code or for settings.

People open folders of others'. Python puts the present folder first where it starts with `-c` or
`-m`, as it does for the processes of a pool; numba reads `.numba_config.yaml` there, whose cache
holds code, matplotlib reads `matplotlibrc`, petsc4py a `petsc.cfg` that names a folder of code, and
Snakemake looks for modules in `.snakemake/pip-deployments`. None of these counts here.
"""

import os
import sys
from collections.abc import Iterator, MutableMapping, Sequence
from contextlib import contextmanager

from carillon.processes import rooms
from carillon.processes.loading import while_loading

_NUMBA = "numba.core.config"
_ELSEWHERE = "/"
_RC = "MATPLOTLIBRC"


def ignore_settings() -> None:
    """Have libraries that are loaded later take nothing from the present folder.

    While numba and matplotlib are loaded, all threads have another one.
    """
    while_loading("matplotlib", _matplotlib_elsewhere)
    while_loading(_NUMBA, _without_file)
    while_loading("snakemake", _without_relative_paths)


def ignore_modules(environment: MutableMapping[str, str], path: Sequence[str]) -> None:
    """Have Python, where it is started from here, import nothing from the present folder.

    Parameters
    ----------
    path
        Where this process looks for modules. Where the first is the folder of Carillon itself, as
        in its checkout, processes that are started from here look there, too; those of an
        installation look into the folder of its rooms.

    Examples
    --------
    >>> environment = {}
    >>> ignore_modules(environment, ["/somewhere", "/else"])
    >>> environment
    {'PYTHONSAFEPATH': '1'}
    """
    if not environment.get("PYTHONSAFEPATH"):
        first = os.path.realpath(path[0] or ".") if path else ""
        own = [each for each in rooms.folders() if each == rooms.INSTALLED or each == first]
        others = environment.get("PYTHONPATH")
        if own:
            environment["PYTHONPATH"] = os.pathsep.join([*own, *([others] if others else [])])
    environment["PYTHONSAFEPATH"] = "1"


@contextmanager
def elsewhere() -> Iterator[None]:
    """Another present folder, of all threads, in the body; not where this one cannot be entered."""
    try:
        here = _here()
    except OSError:  # then nothing in it can be read either
        yield
        return
    try:
        os.chdir(_ELSEWHERE)
        yield
    finally:
        os.chdir(here)
        if isinstance(here, int):
            os.close(here)


def _here() -> int | str:
    """The present folder held open, or its path where no folder can be."""
    if os.chdir in os.supports_fd:
        return os.open(".", getattr(os, "O_PATH", os.O_RDONLY) | os.O_DIRECTORY)
    return os.getcwd()


@contextmanager
def _matplotlib_elsewhere() -> Iterator[None]:
    """Likewise, and the file that the user has named is found from there."""
    named = os.environ.get(_RC)
    if named:
        os.environ[_RC] = os.path.abspath(named)
    try:
        with elsewhere():
            yield
    finally:
        if named:
            os.environ[_RC] = named


@contextmanager
def _without_relative_paths() -> Iterator[None]:
    """Leave out of the folders with modules what the body adds to them from the present folder."""
    before = list(sys.path)
    yield
    sys.path[:] = [path for path in sys.path if path in before or os.path.isabs(path)]


@contextmanager
def _without_file() -> Iterator[None]:
    """Likewise, and numba looks for its file nowhere later, which it does whenever it compiles."""
    with elsewhere():
        yield
    if config := sys.modules.get(_NUMBA):
        config.__dict__["_config_fname"] = os.devnull
