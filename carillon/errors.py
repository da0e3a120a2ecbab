"""Errors that are addressed to the person at the terminal."""


class UserError(Exception):
    """Input that cannot be used: one sentence saying what was found, what was expected, what to do.

    Command-line programs print the sentence and exit with status 2, without a traceback.
    """


class ConvergenceError(RuntimeError):
    """A solver missed the tolerance it was asked for."""
