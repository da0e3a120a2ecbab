"""Errors that are addressed to the person at the terminal."""


class UserError(Exception):
    """Input that cannot be used: one sentence saying what was found, what was expected, what to do.

    Command-line programs print the sentence and exit with status 2, without a traceback.  Under MPI
    all ranks raise it together.
    """

    collective = True


class ConvergenceError(RuntimeError):
    """A solver missed the tolerance it was asked for.  Under MPI all ranks raise it together."""

    collective = True


class LocalConvergenceError(ConvergenceError):
    """A solver that one rank runs on its own missed its tolerance; the other ranks do not know."""

    collective = False
