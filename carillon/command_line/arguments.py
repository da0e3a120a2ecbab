"""Command-line arguments whose mistakes are answered in one sentence."""

import argparse
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NoReturn

from carillon.errors import UserError
from carillon.parameters.sentences import alike

_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$", re.ASCII)


class Parser(argparse.ArgumentParser):
    """Argument parser that raises UserError instead of printing its usage.

    It takes -1e-3 for a number, as later versions of Python do by themselves, not for an option.
    `elsewhere` says of words that are no commands here what to type in their place.
    """

    elsewhere: Mapping[str, str] = MappingProxyType({})

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._negative_number_matcher = _NEGATIVE

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as argparse does, once no option is one that is mistyped."""
        if args is not None and self._subparsers is None:
            self._refuse_mistyped(args)
        return super().parse_known_args(args, namespace)

    def _refuse_mistyped(self, words: Sequence[str]) -> None:
        known = list(self._option_string_actions)
        for word in words:
            if word == "--":
                break
            name = word.partition("=")[0]
            if not name.startswith("--") or any(each.startswith(name) for each in known):
                continue
            if suggestion := alike(name, known):
                self.error(f"no option {name}, did you mean {suggestion}?")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            suggestion = alike(str(value), map(str, action.choices))
            is_command = isinstance(action, argparse._SubParsersAction)
            if is_command and value in self.elsewhere:
                self.error(f"no command {value!r}, {self.elsewhere[value]}")
            if suggestion and is_command:
                self.error(f"no command {value!r}, did you mean {suggestion!r}?")
            if suggestion:
                shown = ", ".join(map(repr, action.choices))
                meant = f"did you mean {suggestion!r}? (choose from {shown})"
                raise argparse.ArgumentError(action, f"invalid choice: {value!r}, {meant}")
        super()._check_value(action, value)

    def error(self, message: str) -> NoReturn:
        """Raise the mistake as a UserError; `exit_status.run` prints it and exits with 2."""
        raise UserError(f"{message} (see {self.prog} --help)")
