"""A program run inside the process of the tests: hostile rows without a process of their own.

What it prints by other means than Python's streams is not seen, what it takes is not bounded; the
same rows are tried as processes in the nightly tier.
"""

import contextlib
import io
import os
import signal
import sys
import time
import traceback
from collections.abc import Iterator

from tests.zygote import Job, Outcome, run_room


def run_inside(job: Job) -> Outcome:
    """What the program `job.room` prints and ends with; its limits and rights are not applied."""
    printed = [io.TextIOWrapper(io.BytesIO(), "utf-8", "backslashreplace") for _ in range(2)]
    begin = time.process_time()
    with _restored(job):
        sys.stdin = io.StringIO()
        sys.stdout, sys.stderr = printed
        try:
            status = run_room(job.room)
        except BaseException:
            traceback.print_exc(file=printed[1])
            status = 1
    texts = [_text(each) for each in printed]
    return Outcome(status, *texts, time.process_time() - begin, 0, False, ())


def _text(printed: io.TextIOWrapper) -> str:
    printed.flush()
    assert isinstance(printed.buffer, io.BytesIO)
    return printed.buffer.getvalue().decode(errors="replace")


@contextlib.contextmanager
def _restored(job: Job) -> Iterator[None]:
    """In the job's folder, with its arguments; what a program changes of a process is put back."""
    folder, environment = os.getcwd(), dict(os.environ)
    streams, words = (sys.stdin, sys.stdout, sys.stderr), sys.argv
    handlers = {number: signal.getsignal(number) for number in signal.valid_signals()}
    os.chdir(job.folder)
    os.environ.update(job.environment)
    sys.argv = [job.room, *job.arguments]
    mask = os.umask(0o022)
    try:
        yield
    finally:
        os.umask(mask)
        os.chdir(folder)
        sys.stdin, sys.stdout, sys.stderr = streams
        sys.argv = words
        os.environ.clear()
        os.environ.update(environment)
        for number, handler in handlers.items():
            if signal.getsignal(number) is not handler and handler is not None:
                signal.signal(number, handler)
