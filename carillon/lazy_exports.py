"""What packages export, loaded when first asked for, where loading it takes long."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def exports(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """The function `__getattr__` of a package.

    `modules`: the module that has it, by the name that is exported; relative to the package.

    Examples
    --------
    >>> exports("carillon", {"UserError": "errors"})("UserError")
    <class 'carillon.errors.UserError'>
    """

    def load(name: str) -> Any:
        if name in modules:
            return getattr(import_module(f"{package}.{modules[name]}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return load
