"""Messages to one page, in order, without a backlog: of what only the newest counts, it is sent."""

from __future__ import annotations

import asyncio
import json
from collections import OrderedDict
from collections.abc import Mapping
from itertools import count
from typing import Any

Message = str | bytes

LONGEST_FEED = 512
"""Messages that wait for a page; one that leaves more waiting is cut off, and asks anew."""


class Feed:
    """Messages that wait to be sent to a page; used in the thread of the event loop alone.

    Examples
    --------
    >>> feed = Feed()
    >>> for text in ("early", "late"):
    ...     feed.put(text, newest="state")
    >>> feed.put("and more")
    >>> asyncio.run(feed.next()), asyncio.run(feed.next())
    ('late', 'and more')
    """

    def __init__(self) -> None:
        self._waiting: OrderedDict[str | int, Message] = OrderedDict()
        self._numbers = count()
        self._changed = asyncio.Event()
        self.closed = False

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits to be sent."""
        return not self._waiting

    def put(self, message: Message, newest: str | None = None) -> None:
        """Add a message.

        Parameters
        ----------
        newest
            Name of a kind of messages of which only the newest counts: one of them that still
            waits is dropped.  None for messages that all count.
        """
        if self.closed:
            return
        key: str | int = next(self._numbers) if newest is None else newest
        self._waiting.pop(key, None)
        self._waiting[key] = message
        if len(self._waiting) > LONGEST_FEED:
            self.close()
        self._changed.set()

    def send(self, event: Mapping[str, Any], newest: str | None = None) -> None:
        """Add an event or a reply, as JSON; parameters as for `put`."""
        self.put(as_json(event), newest)

    async def next(self) -> Message | None:
        """The message that has waited longest; None once the feed is closed."""
        while not self._waiting and not self.closed:
            self._changed.clear()
            await self._changed.wait()
        return None if self.closed else self._waiting.popitem(last=False)[1]

    def close(self) -> None:
        """End the feed; what waits is dropped."""
        self.closed = True
        self._waiting.clear()
        self._changed.set()


def as_json(value: Any) -> str:
    """A value as JSON of the strict kind, which browsers read.

    Raises
    ------
    ValueError
        If there is a number in it that JSON does not have: an infinite one, or none.
    """
    return json.dumps(value, allow_nan=False, separators=(",", ":"))
