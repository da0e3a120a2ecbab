"""Where caches are kept if the user's cannot be written, those of compiled kernels above all.

Numba keeps them in the folder that NUMBA_CACHE_DIR names, beside the source, or in the user's cache
(`~/.cache/numba`), and refuses to work where none of these can be written: in a checkout of another
user's, or a container, without a home. Then they go into a private folder for temporary files, and
where there is none either, they are compiled every time. A folder elsewhere begins with a copy of
the kernels beside the source.

Kernels for several kinds of processors are in one folder. Numba's index tells them apart, but numba
numbers the files of code: two processes that compile at once may take one number, and the next run
may load code for another processor. Here the name of a file tells its content.

Numba compiles a kernel anew when its own file has changed. Here it does, too, when a kernel that it
calls, or a constant that it uses, has changed in another file, since both are within its code.
"""

import hashlib
import logging
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from carillon.files.paths import is_own, user
from carillon.files.system import may_write
from carillon.processes.loading import while_loading

logger = logging.getLogger(__name__)

FOLDER = "carillon-cache"
"""Name of the private folder, before the number of its user."""
PLACES = ("/tmp", "/var/tmp", "/dev/shm")
"""Folders besides TMPDIR that may hold compiled kernels."""

_CACHING = "numba.core.caching"
_CLASSES = "NUMBA_CACHE_LOCATOR_CLASSES"
_DIRECTORY = "NUMBA_CACHE_DIR"
_RANKS = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")
_COMPILED = ("*.nbc", "*.nbi")
"""Files of numba's: code, and after it the index that names it."""


_on_compilation: list[Callable[[], None]] = []


def tell_compilation(tell: Callable[[], None]) -> None:
    """Call `tell` when this process has to compile a kernel, the first time only."""
    _on_compilation[:] = [tell]


def configure(environment: MutableMapping[str, str]) -> None:
    """Have numba ask `Locator` where to keep kernels, if the user's cache cannot be written.

    Others, such as Snakemake, which ends without a cache, get the private folder for theirs.
    """
    while_loading(_CACHING, _mended)
    cache = environment.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if _can_be_made(os.path.join(cache, "numba")):
        return
    environment.setdefault(_CLASSES, f"{__name__}.Locator")
    if folder := private_folder():
        environment["XDG_CACHE_HOME"] = str(folder)


class Locator:
    """What numba asks for a kernel's place, instead of its own list of such classes."""

    folder: Path | None = None
    """Within the private one, once it is used."""

    @classmethod
    def from_function(cls, function: Any, source: str) -> Any:
        """The place of a kernel: by numba's own rules, in a private folder, or nowhere."""
        caching, config = _numba()
        # Numba has read it; programs that are started from here may not know this package.
        if os.environ.get(_CLASSES) == f"{__name__}.{cls.__name__}":
            del os.environ[_CLASSES]
        if config.CACHE_DIR != str(cls.folder):
            for known in caching.CacheImpl._locator_classes:
                own = "UserWide" not in known.__name__  # that cannot be written
                if own and (locator := known.from_function(function, source)):
                    return locator
            folder = private_folder()
            if folder is None:
                return _kept_nowhere(function, source)
            cls.folder = folder / "kernels"
            cls.folder.mkdir(exist_ok=True)
            _say(f"compiled kernels are kept in {cls.folder}, as the user's cache is not writable")
            config.CACHE_DIR = os.environ[_DIRECTORY] = str(cls.folder)
        place = caching.UserProvidedCacheLocator(function, source)
        place.ensure_cache_path()
        return place


def private_folder() -> Path | None:
    """A folder for temporary files that this user alone can write; None if there is none.

    What others could write is not used: kernels in it are code that would be run.
    """
    for place in filter(None, (os.environ.get("TMPDIR"), *PLACES)):
        folder = Path(place).absolute() / f"{FOLDER}-{user()}"
        with suppress(OSError):
            folder.mkdir(mode=0o700, exist_ok=True)
            status = folder.lstat()
            if is_own(status, stat.S_ISDIR) and not status.st_mode & 0o077:
                tempfile.TemporaryFile(dir=folder).close()
                return folder
    return None


def _kept_nowhere(function: Any, source: str) -> Any:
    """Kernels that are beside the source are used; what is compiled now is forgotten."""
    caching, _ = _numba()
    if caching.Cache.save_overload is not _forget:
        _say(
            f"compiled kernels are kept nowhere and are compiled every time, as no folder for them "
            f"can be written; name one by {_DIRECTORY}"
        )
        caching.Cache.save_overload = _forget
    return caching.InTreeCacheLocator(function, source)


@contextmanager
def _mended() -> Iterator[None]:
    """Change where and by what names numba keeps kernels, as soon as its module is loaded."""
    yield
    caching: Any = sys.modules.get(_CACHING)
    if caching is None:  # it is about to be
        return
    caching.IndexDataCacheFile.save = _save
    caching.Cache.__init__ = _with_stamp_of_what_it_uses(caching.Cache.__init__)
    caching.Cache.load_overload = _telling_of_missing(caching.Cache.load_overload)
    for elsewhere in (caching.UserProvidedCacheLocator, caching.UserWideCacheLocator):
        elsewhere.ensure_cache_path = _ensure_copy


def _save(self: Any, key: Any, compiled: Any) -> None:
    """Keep a kernel in a file whose name tells its source, types and processor."""
    index = self._load_index()
    if key not in index:
        content = hashlib.sha256(repr((self._source_stamp, key)).encode()).hexdigest()[:16]
        index[key] = f"{self._index_name.removesuffix('.nbi')}.{content}.nbc"
        self._save_index(index)
    self._save_data(index[key], compiled)


def _telling_of_missing(load: Callable[..., Any]) -> Callable[..., Any]:
    def loaded(self: Any, *given: Any, **named: Any) -> Any:
        kernel = load(self, *given, **named)
        if kernel is None and _on_compilation:
            _on_compilation.pop()()
        return kernel

    return loaded


def _with_stamp_of_what_it_uses(begin: Callable[[Any, Any], None]) -> Callable[[Any, Any], None]:
    def begun(self: Any, function: Any) -> None:
        begin(self, function)
        file = self._cache_file
        used = repr(sorted(_used(function)))
        file._source_stamp = (file._source_stamp, hashlib.sha256(used.encode()).hexdigest())

    return begun


def _used(function: Any) -> Iterator[str]:
    """Kernels that a function calls, by the stamps of their sources, and constants it uses."""
    cells = zip(function.__code__.co_freevars, function.__closure__ or ())
    names = {name: cell.cell_contents for name, cell in cells}
    for name in function.__code__.co_names:
        if name in function.__globals__:
            names[name] = function.__globals__[name]
    for name, value in names.items():
        called = getattr(value, "py_func", None) or getattr(value, "_defn", None)
        if isinstance(value, bool | int | float | str | tuple):
            yield f"{name} {value!r}"
        elif file := getattr(getattr(value, "_cache", None), "_cache_file", None):
            yield f"{name} {file._source_stamp}"
        elif called is not None:
            status = os.stat(called.__code__.co_filename)
            yield f"{name} {status.st_mtime} {status.st_size}"


def _ensure_copy(self: Any) -> None:
    """Make a folder for kernels elsewhere, with those that are beside the source."""
    caching, _ = _numba()
    with suppress(OSError):
        _take_over(Path(self._py_file).parent / "__pycache__", Path(self.get_cache_path()))
    caching._CacheLocator.ensure_cache_path(self)


def _numba() -> tuple[Any, Any]:
    from numba.core import caching, config

    return caching, config


def _forget(*_: Any) -> None:
    return None


def _take_over(old: Path, new: Path) -> None:
    """Copy kernels that were compiled beside the source, as numba knows them again by its hash."""
    if new.is_dir() or not old.is_dir():
        return
    new.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=new.parent) as folder:
        for each in _files(old):
            shutil.copyfile(each, Path(folder) / each.name)
        new.mkdir(mode=0o700, exist_ok=True)
        for each in _files(Path(folder)):
            os.replace(each, new / each.name)


def _files(folder: Path) -> list[Path]:
    return [each for pattern in _COMPILED for each in folder.glob(pattern)]


def _can_be_made(folder: str) -> bool:
    """Whether this user may write to a folder, or make it; "~" is none, of unknown users."""
    if not os.path.isabs(folder):
        return False
    while not os.path.lexists(folder):
        folder = os.path.dirname(folder)
    return os.path.isdir(folder) and may_write(folder)


def _say(sentence: str) -> None:
    if all(os.environ.get(name, "0") == "0" for name in _RANKS):
        logger.warning(sentence)
