"""Progress of `carillon design` while it searches, and while it chooses materials."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from carillon.command_line.counts import counted
from carillon.command_line.progress import LINE_SECONDS, say
from sound.design.objective import fall

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from sound.building.restriction import BuildProgress
    from sound.design.search import Search

ERASE = "\x1b[2K"
"""Erases the line of a terminal."""
SHOWN_EVERY = 1.0
"""Time between two progress lines on a terminal [s]."""


class _ProgressLine:
    """A line that changes: in place on a terminal, one a minute in a log."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._due = time.monotonic() + (0.0 if self._terminal else LINE_SECONDS)

    @property
    def is_due(self) -> bool:
        """Whether it is time for the next one; then it is awaited from now on."""
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + (SHOWN_EVERY if self._terminal else LINE_SECONDS)
        return True

    def write(self, text: str) -> None:
        """Print the line."""
        if self._terminal:
            say(f"{ERASE}{text}", end="\r")
        else:
            say(text)

    def end(self) -> None:
        """Erase the line on a terminal."""
        if self._terminal:
            say(ERASE, end="\r")


class BuildLine(_ProgressLine):
    """Analyses and cost of a restriction to real materials."""

    def show(self, at: BuildProgress) -> None:
        """Print progress, if it is due."""
        if self.is_due:
            self.write(
                f"materials: {at.made} of {counted(at.most, 'evaluation')}  cost "
                f"{at.cost.total:9.4g} (rounded {at.rounded.total:.4g})"
            )


class SearchLine(_ProgressLine):
    """Cost and time of a search."""

    def show(self, search: Search) -> None:
        """Print progress, if it is due."""
        if not self.is_due:
            return
        entry, first = search.history[-1], search.history[0]
        cost = entry.cost
        text = (
            f"{search.own_seconds:6.1f} s  {counted(search.own_evaluations, 'evaluation')}  "
            f"cost {cost.total:9.4g} ({fall(first.cost.total, cost.total):.1%} less)  "
            f"frequencies {cost.frequency:8.3g}  amplitudes {cost.amplitude:8.3g}"
        )
        if search.checks:
            best = min(search.checks, key=lambda check: check.cost)
            text += (
                f"  rms {best.coarse_rms_cents:.1f} cents coarse, {best.fine_rms_cents:.1f} fine"
            )
        self.write(text)
