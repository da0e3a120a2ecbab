"""Messages to pages, in order, without a backlog: of what only the newest counts, it is sent."""

import asyncio
import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
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

    def put(self, message: Message, newest: str | None = None) -> None:
        """Add a message; of those of one kind `newest` only the newest counts, and one that waits
        is dropped.
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

    Raises ValueError if there is a number in it that JSON does not have: an infinite one, or none.
    """
    return json.dumps(value, allow_nan=False, separators=(",", ":"))


class Pages:
    """Feeds of all pages; `state` and `history` make the events of these names, which a new page is
    told first.
    """

    def __init__(
        self, state: Callable[[], dict[str, Any]], history: Callable[[], dict[str, Any]]
    ) -> None:
        self._state, self._history = state, history
        self._bank: bytes | None = None
        self._feeds: set[Feed] = set()

    @property
    def bank(self) -> bytes | None:
        """What the solid sounds like, as it was told last."""
        return self._bank

    def subscribe(self) -> Feed:
        """A feed that begins with all that there is."""
        feed = Feed()
        self._feeds.add(feed)
        feed.send(self._state(), "state")
        feed.send(self._history())
        if self._bank is not None:
            feed.put(self._bank, "bank")
        return feed

    def unsubscribe(self, feed: Feed) -> None:
        """Send nothing more to a feed."""
        self._feeds.discard(feed)

    def close(self) -> None:
        """End all feeds."""
        for feed in self._feeds:
            feed.close()

    def tell(self, event: Mapping[str, Any], newest: str | None = None) -> None:
        """Tell an event; parameters as for `Feed.send`."""
        for feed in self._feeds:
            feed.send(event, newest)

    def tell_state(self) -> None:
        """Tell the state as it is now."""
        self.tell(self._state(), "state")

    def tell_history(self) -> None:
        """Tell the history as it is now."""
        self.tell(self._history())

    def tell_bank(self, bank: bytes) -> None:
        """Tell what the solid sounds like."""
        self._bank = bank
        for feed in self._feeds:
            feed.put(bank, "bank")

    def say(self, text: str, kind: str = "note") -> None:
        """Tell a sentence, a `note` or an `error`."""
        self.tell({"event": "said", "text": text, "kind": kind})
