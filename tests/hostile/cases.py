"""Rows of the table: a command line, the files it meets, and how it has to end."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

ZOO = "ZOO/"
"""Stands in command lines for the folder of prepared files, see `tests.hostile.zoo`."""

LONG = "x" * 300
"""What the word LONG in values stands for: a name that no file system takes."""

Arguments = str | Sequence[str]


@dataclass(frozen=True)
class Copy:
    """A file of the zoo, to be put into the working folder; `rights` as of chmod."""

    name: str
    rights: int = 0o644


@dataclass(frozen=True)
class Place:
    """What is put into the working folder that is no file.

    `kind` is "folder" (with `rights`), "pipe", "link" (to `target`), "null" or "full" (a device).
    """

    kind: str
    target: str = ""
    rights: int = 0o755


@dataclass(frozen=True)
class Case:
    """One row.

    Attributes
    ----------
    name : tells the row apart in its room, and says what is hostile about it.
    room, arguments : of `python -m ROOM ARGUMENTS...`.
    says : words that the sentence contains, whatever their case.
    status : exit status; 0 for a control, a valid command that has to work.
    files : in the working folder, by name: their text, their bytes, a copy, or what is no file.
    writes : for a control, the files that it leaves; all it leaves, but for folders.
    plain : whether it runs without the rights of root.
    file_size : largest file that can be written [bytes], as on a full disk.
    usual : whether it is tried with every change, or else by the nightly tier alone.
    inside : whether it runs inside the process of the tests, and not as one of its own.
    """

    name: str
    room: str
    arguments: tuple[str, ...]
    says: tuple[str, ...] = ()
    status: int = 2
    files: Mapping[str, str | bytes | Copy | Place] = field(default_factory=dict)
    writes: tuple[str, ...] = ()
    plain: bool = False
    file_size: int = 1 << 28
    usual: bool = True
    inside: bool = False

    @property
    def control(self) -> bool:
        """Whether it is valid."""
        return self.status == 0


class Table:
    """Rows of one room, in order."""

    def __init__(self, room: str) -> None:
        self.room = room
        self.rows: list[Case] = []

    def hostile(self, name: str, arguments: Arguments, *says: str, **more: object) -> None:
        """Add a row that has to be refused with a sentence that contains the words `says`."""
        self._add(Case(name, self.room, _split(arguments), tuple(says)), more)

    def control(self, name: str, arguments: Arguments, *writes: str, **more: object) -> None:
        """Add a row that has to work and to leave the files `writes`."""
        row = Case(f"{name}, valid", self.room, _split(arguments), status=0, writes=writes)
        self._add(row, more)

    def each(
        self, name: str, arguments: Arguments, values: Arguments, *says: str, **more: object
    ) -> None:
        """Add a row for each of the values, which take the place of the word VALUE.

        Every fifth one is tried with every change, and all that have once got through. Values of
        one text are split as in a shell, braces too; see `WORDS`.
        """
        for number, value in enumerate(_expanded(values) if isinstance(values, str) else values):
            words = [word.replace("VALUE", value) for word in _split(arguments)]
            usual = number % 5 == 0 or any(word in value for word in GOT_THROUGH)
            self.hostile(f"{name} {_shown(value)}", words, *says, usual=usual, **more)

    def places(self, name: str, arguments: Arguments, file: str, *says: str) -> None:
        """Add a row for each kind of place that stands where the file is expected."""
        for kind in ("folder", "null", "full", "pipe", "socket"):
            self.hostile(f"{name} {kind}", arguments, *says, files={file: Place(kind)})

    def _add(self, row: Case, more: Mapping[str, object]) -> None:
        command = row.arguments[0] if len(row.arguments) > 1 else self.room
        row = replace(row, name=f"{command}: {row.name}", **more)  # type: ignore[arg-type]
        assert row.name not in {other.name for other in self.rows}, row.name
        self.rows.append(row)


CLOSED: dict[str, Any] = {"files": {"closed": Place("folder", rights=0o555)}, "plain": True}
"""A folder `closed` that nothing may be written to."""


def unreadable(name: str, original: str) -> dict[str, Any]:
    """A copy of a file of the zoo that may not be read."""
    return {"files": {name: Copy(original, rights=0)}, "plain": True}


def _split(arguments: Arguments) -> tuple[str, ...]:
    return tuple(shlex.split(arguments) if isinstance(arguments, str) else arguments)


def _expanded(values: str) -> Iterator[str]:
    """Words of a text.

    >>> list(_expanded("a-{b,c}.h5 '' 2**64 LONG.h5"))[:4]
    ['a-b.h5', 'a-c.h5', '', '18446744073709551616']
    """
    for word in shlex.split(values):
        head, _, rest = word.partition("{")
        inside, _, tail = rest.partition("}")
        if word in WORDS:
            yield from WORDS[word]
        elif "**" in word:
            base, exponent = word.split("**")
            yield str(int(base) ** int(exponent))
        else:
            yield from (f"{head}{each}{tail}".replace("LONG", LONG) for each in inside.split(","))


def _shown(value: str) -> str:
    """A value in the name of a row: short, printable."""
    value = value.removeprefix(ZOO)
    text = value if len(value) <= 40 else f"{value[:20]}... ({len(value)})"
    return repr(text) if not text or not text.isprintable() or " " in text else text


GOT_THROUGH = (
    *("1e300", "1e-300", "nan", "1000000", "1e10", "18446744073709551616", "x" * 300),
    *("claims", "complex", "bool", "datetime", "unsealed", "bomb", "nested", "mp3", "pipe"),
)
"""Parts of values that were once accepted, or answered with a traceback or no end."""
NO_WHOLE_NUMBERS = ("", "nan", "inf", "1.5", "1e3", "1_000", "0x10", "１２", "+-1", "10" * 15, "a")
"""Texts that stand for no whole number, or for one beyond 64 bits."""
NO_NUMBERS = ("", "nan", "inf", "-inf", "0x10", "1e999", "1,5", "一")
"""Texts that stand for no finite number."""
WORDS = {"NO_WHOLE_NUMBERS": NO_WHOLE_NUMBERS, "NO_NUMBERS": NO_NUMBERS}
"""What words in values stand for."""
