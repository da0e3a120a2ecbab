"""What a program shows of the messages that modules log: a line each, on standard error.

Modules log under their own names, `logging.getLogger(__name__)`; whoever imports them decides with
the standard library what becomes of it.
"""

import logging
from functools import cache

from carillon import ROOMS
from carillon.command_line.progress import say


class _LineHandler(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        """Show a message."""
        say(self.format(record))


_LINES = _LineHandler()


@cache
def warn_once(sentence: str) -> None:
    """Log a warning, once in a process, however often the same input is read."""
    logging.getLogger(__name__).warning(f"warning: {sentence}")


def show() -> None:
    """Show messages of all rooms from now on."""
    for room in ROOMS:
        logger = logging.getLogger(room)
        logger.setLevel(logging.INFO)
        logger.addHandler(_LINES)  # once, however often it is asked for
