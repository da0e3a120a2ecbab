"""Errors that are addressed to the person at the terminal."""

LONGEST_MESSAGE = 1200
"""Longest message in characters; a longer one loses its middle, so that it fits on a screen."""


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
    MPI all ranks raise it together.

    Examples
    --------
    >>> print(UserError("no file a.wav; name another", "no file b.wav; name another"))
    no file a.wav; name another
    no file b.wav; name another
    """

    collective = True

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


class LocalUserError(UserError):
    """Input that one rank finds unusable while the others are at work; they do not know."""

    collective = False
