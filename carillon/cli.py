"""How every command-line program of Carillon ends: cleanly, with one sentence when input is bad."""

from __future__ import annotations

import sys
from collections.abc import Callable

from carillon.errors import ConvergenceError, UserError

EXIT_BAD_INPUT = 2
EXIT_NOT_CONVERGED = 3


def run(program: str, main: Callable[[], int | None]) -> int:
    """Call `main` and turn errors meant for the user into one sentence and an exit status."""
    try:
        return main() or 0
    except UserError as error:
        print(f"{program}: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except ConvergenceError as error:
        print(f"{program}: {error}", file=sys.stderr)
        return EXIT_NOT_CONVERGED
    except BrokenPipeError:
        return 0
