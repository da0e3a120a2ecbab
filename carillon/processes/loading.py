"""Context managers in which modules of libraries are loaded, whoever imports them first."""

import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

Context = Callable[[], AbstractContextManager[None]]


def while_loading(name: str, context: Context) -> None:
    """Have a module, unless it is loaded already, be loaded in the body of a context manager.

    Examples
    --------
    >>> from contextlib import contextmanager
    >>> @contextmanager
    ... def told():
    ...     yield print("before")
    ...     print("after")
    >>> while_loading("this_is_no_module", told)
    >>> import this_is_no_module
    Traceback (most recent call last):
    ModuleNotFoundError: No module named 'this_is_no_module'
    """
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
    _contexts[name] = context


_contexts: dict[str, Context] = {}


class _Finder(MetaPathFinder):
    """Finds what Python would, and has it loaded by a loader that enters its context."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name not in _contexts:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = _ContextLoader(spec.loader, _contexts[name])
        return spec


class _ContextLoader(Loader):
    def __init__(self, loader: Loader, context: Context) -> None:
        self._loader, self._context = loader, context

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        with self._context():
            return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        with self._context():
            self._loader.exec_module(module)
        # Who asks later finds the module's own loader.
        module.__loader__ = self._loader
        if module.__spec__ is not None:
            module.__spec__.loader = self._loader
