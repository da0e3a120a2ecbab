"""Time that a step of a training took, also where it was killed and went on."""

import time
from dataclasses import dataclass


@dataclass(frozen=True)
class Spent:
    """Times of one process."""

    seconds: float = 0.0
    """Wall time."""
    processor_seconds: float = 0.0
    """Processor time of all its threads."""

    def __add__(self, other: "Spent") -> "Spent":
        return Spent(self.seconds + other.seconds, self.processor_seconds + other.processor_seconds)


class Stopwatch:
    """Runs from when it is made, or from the last reading on."""

    def __init__(self) -> None:
        self._last = self._now()

    def read(self) -> Spent:
        """Time since the last reading."""
        before, self._last = self._last, self._now()
        return Spent(
            self._last.seconds - before.seconds,
            self._last.processor_seconds - before.processor_seconds,
        )

    def _now(self) -> Spent:
        return Spent(time.monotonic(), time.process_time())
