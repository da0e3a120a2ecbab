"""The WebSocket: events to the page, calls from the page and their replies."""

import asyncio
import json
import traceback
from typing import Any, NoReturn

from starlette.websockets import WebSocket, WebSocketDisconnect

from carillon.command_line import exit_status
from carillon.errors import UserError
from studio.feed import Feed
from studio.interface import Studio

LARGEST = 2**53
"""Largest number of a call; browsers do not tell larger whole numbers apart."""
MOST_CALLS = 32
"""Most calls of a page that are under way at a time; more wait."""
OWN_FAULT = "the studio itself failed at this; what it printed says why"
"""Answer to a call that fails by a fault of the program."""
TOO_SLOW = 1013
"""Why a feed is cut off, as WebSockets number it: try again later."""


async def talk(page: WebSocket, studio: Studio) -> None:
    """Serve a page until it leaves, or does not keep up."""
    await page.accept()
    feed = studio.subscribe()
    try:
        listening = asyncio.create_task(_listen(page, studio, feed))
        telling = asyncio.create_task(_tell(page, feed))
        await asyncio.wait((listening, telling), return_when=asyncio.FIRST_COMPLETED)
        for task in (listening, telling):
            task.cancel()
        await asyncio.gather(listening, telling, return_exceptions=True)
    finally:
        studio.unsubscribe(feed)
        feed.close()


async def _tell(page: WebSocket, feed: Feed) -> None:
    while (message := await feed.next()) is not None:
        if isinstance(message, bytes):
            await page.send_bytes(message)
        else:
            await page.send_text(message)
    await page.close(TOO_SLOW)


async def _listen(page: WebSocket, studio: Studio, feed: Feed) -> None:
    """Start the calls in their order, each as a task: `stop` need not wait for what is slow."""
    under_way: set[asyncio.Task[None]] = set()
    try:
        while True:
            message = await page.receive()
            if message["type"] == "websocket.disconnect":
                return
            text = message.get("text")
            under_way.add(asyncio.create_task(_serve(text, studio, feed)))
            # What has been called begins before what is called next.
            await asyncio.sleep(0)
            under_way = {task for task in under_way if not task.done()}
            if len(under_way) >= MOST_CALLS:
                await asyncio.wait(under_way, return_when=asyncio.FIRST_COMPLETED)
    except WebSocketDisconnect:
        return


async def _serve(text: str | None, studio: Studio, feed: Feed) -> None:
    number: int | str | None = None
    try:
        if text is None:
            raise UserError("the message is binary; expected JSON as text")
        message = _message(text)
        number = _number(message.pop("id", None))
        await studio.call(str(message.pop("do", None)), message)
    except Exception as error:
        feed.send({"reply": number, "error": sentence_of(error)})
    else:
        feed.send({"reply": number})


def _message(text: str) -> dict[str, Any]:
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        said = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise UserError(f"the message is no JSON ({said}); expected an object") from None
    if not isinstance(message, dict):
        raise UserError('the message is no object; expected {"id": 1, "do": "..."}')
    return message


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"found {name}")


def _number(number: Any) -> int:
    if isinstance(number, bool) or not isinstance(number, int) or abs(number) > LARGEST:
        raise UserError(f"id is {number!r:.100}, expected a whole number")
    return number


def sentence_of(error: Exception) -> str:
    """What a person is told of an error; faults of the program's are printed as well."""
    _, sentence = exit_status.meaning(error)
    if sentence is None:
        traceback.print_exception(error)
    return sentence or OWN_FAULT
