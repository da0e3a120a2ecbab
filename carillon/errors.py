"""Errors that are addressed to the person at the terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

LONGEST_MESSAGE = 1200
"""Longest message in characters; a longer one loses its middle, so that it fits on a screen."""


def as_text(name: str) -> str:
    """Text whose bytes that are no text are escapes, as files and pages can hold it.

    Examples
    --------
    >>> print(as_text("bell.obj"), as_text("\\udcff.obj"))
    bell.obj \\udcff.obj
    """
    return name.encode(errors="backslashreplace").decode()


def one_line(text: str) -> str:
    """Text fit for a terminal: one line, printable characters only, no longer than a screen.

    Messages quote what users give: names with line breaks, escape sequences or bytes that are no
    text, values of megabytes.

    Examples
    --------
    >>> one_line("no file 'a\\nb\\x1b[2J'; name another")
    "no file 'a b\\\\x1b[2J'; name another"
    >>> len(one_line("x" * 10**6)) == LONGEST_MESSAGE
    True
    """
    if len(text) > LONGEST_MESSAGE:
        half = (LONGEST_MESSAGE - 5) // 2
        text = f"{text[: LONGEST_MESSAGE - 5 - half]} ... {text[-half:]}"
    words = " ".join(text.split())
    printable = (c if c.isprintable() else c.encode("unicode_escape").decode() for c in words)
    return "".join(printable)


class UserError(Exception):
    """Input that cannot be used: one sentence saying what was found, what was expected, what to do.

    Of several faults that are told together each is an argument: a sentence on a line of its own.
    Command-line programs print the sentences and exit with status 2, without a traceback.  Under
    MPI it is taken for one rank's own, and ends the other ranks, unless `on_all_ranks` marks it.

    Examples
    --------
    >>> print(UserError("no file a.wav; name another", "no file b.wav; name another"))
    no file a.wav; name another
    no file b.wav; name another
    """

    collective: bool = False

    def __str__(self) -> str:
        return "\n".join(one_line(str(fault)) for fault in self.args)


class ConvergenceError(RuntimeError):
    """A solver missed the tolerance it was asked for.  Under MPI all ranks raise it together."""

    collective = True

    def __str__(self) -> str:
        return one_line(super().__str__())


class LocalConvergenceError(ConvergenceError):
    """A solver that one rank runs on its own failed; the other ranks do not know."""

    collective = False


@contextmanager
def on_all_ranks() -> Iterator[None]:
    """Mark a UserError raised in the body, or in a decorated function, as one that all ranks raise.

    So it is where all of them do the same with the same values, such as with the command line: each
    returns by itself, and the first one tells the error.

    Examples
    --------
    >>> try:
    ...     with on_all_ranks():
    ...         raise UserError("8 ranks for 4 subdomains; start 4")
    ... except UserError as error:
    ...     print(error.collective)
    True
    """
    try:
        yield
    except UserError as error:
        error.collective = True
        raise
