"""All pages that are open: what is told to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from studio.feed import Feed


class Pages:
    """Feeds of all pages.

    Parameters
    ----------
    state, history
        Make the events of these names, which a new page is told first.
    """

    def __init__(
        self, state: Callable[[], dict[str, Any]], history: Callable[[], dict[str, Any]]
    ) -> None:
        self._state, self._history = state, history
        self._bank: bytes | None = None
        self._feeds: set[Feed] = set()

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
