"""How much Hypothesis tries, and what it does to bytes and texts."""

import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from carillon.errors import UserError

Result = TypeVar("Result")

FILES = frozenset({"test_properties.py", "test_properties_files.py"})
"""Tests that take the profiles of Hypothesis below."""
MORE = 20
"""How many times more examples the profiles part and nightly take, the latter others each time."""
ONCE = 100
EXTRA_BYTES = 1 << 30
"""Memory that reading may take beyond what the process has: files here are far below a megabyte."""


settings.register_profile(
    "change",
    max_examples=ONCE,
    derandomize=True,
    database=None,
    deadline=None,
    print_blob=True,
    suppress_health_check=list(HealthCheck),
)
# The same on every machine, so that a change is not refused for what it has nothing to do with.
settings.register_profile("part", settings.get_profile("change"), max_examples=ONCE * MORE)
settings.register_profile("nightly", settings.get_profile("part"), derandomize=False)


def load(profile: str) -> None:
    """Take a profile for tests that are loaded later: of a change, a part of the rest, or all."""
    settings.load_profile(profile)


def examples(count: int) -> settings:
    """Settings for `count` examples, or as many times more as the profile takes."""
    return settings(max_examples=count * settings.default.max_examples // ONCE)


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """`content` after what happens to bytes: cut, flipped, overwritten, moved, replaced."""
    place = st.integers(0, max(0, len(content) - 1))
    match draw(st.sampled_from(["cut", "flip", "flip", "write", "insert", "remove", "junk"])):
        case "cut":
            return content[: draw(place)]
        case "flip":
            changed = bytearray(content)
            for _ in range(draw(st.integers(1, 4))):
                changed[draw(place)] ^= 1 << draw(st.integers(0, 7))
            return bytes(changed)
        case "write":
            at, piece = draw(place), draw(st.binary(min_size=1, max_size=16))
            return content[:at] + piece + content[at + len(piece) :]
        case "insert":
            at = draw(place)
            return content[:at] + draw(st.binary(min_size=1, max_size=64)) + content[at:]
        case "remove":
            first, last = sorted([draw(place), draw(place)])
            return content[:first] + content[last:]
        case _:
            return draw(st.binary(max_size=600))


def or_refused(read: Callable[[], Result]) -> Result | None:
    """What `read` returns, or None if it raises a UserError of one short line.

    Any other exception passes, a lack of memory too.
    """
    try:
        with bounded_memory():
            return read()
    except UserError as error:
        text = str(error)
        assert text and text.isprintable() and len(text) <= 1300, text
        return None


@contextmanager
def bounded_memory() -> Iterator[None]:
    """No more than `EXTRA_BYTES` of address space in the body, beyond what there is."""
    with open("/proc/self/statm") as file:
        now = int(file.read().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (now + EXTRA_BYTES, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def yaml_texts() -> st.SearchStrategy[str]:
    """YAML, and what is nearly YAML."""
    scalar = st.one_of(
        st.text(max_size=12),
        st.integers().map(str),
        st.floats().map(str),
        st.sampled_from(
            [
                *(
                    ".nan",
                    "-.inf",
                    "1e400",
                    "null",
                    "~",
                    "yes",
                    "0o17",
                    "0x1F",
                    "1_000",
                    "2020-01-01",
                ),
                *(
                    "!!python/name:os.system",
                    "!!binary AAAA",
                    "&a 1",
                    "*a",
                    "<<",
                    "%",
                    "@",
                    "|",
                    ">",
                ),
            ]
        ),
    )
    nested = st.recursive(
        scalar,
        lambda inner: st.one_of(
            st.lists(inner, max_size=4).map(lambda parts: f"[{', '.join(parts)}]"),
            st.dictionaries(scalar, inner, max_size=4).map(
                lambda parts: "{" + ", ".join(f"{key}: {part}" for key, part in parts.items()) + "}"
            ),
        ),
        max_leaves=12,
    )
    lines = st.lists(st.tuples(scalar, nested).map(": ".join), max_size=5).map("\n".join)
    return st.one_of(nested, lines, st.text(max_size=80))


def values() -> st.SearchStrategy[object]:
    """What a key of a description can hold once YAML has been read."""
    scalar = st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.integers(-(10**40), 10**40),
        st.floats(),
        st.text(max_size=20),
        st.sampled_from(
            ["builtin:bar", "builtin:", "$(touch x)", "a\0b", "a\nb", "../x", "x" * 300]
        ),
    )
    return st.recursive(
        scalar,
        lambda inner: st.one_of(
            st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=8), inner, max_size=3)
        ),
        max_leaves=6,
    )
