"""Numbers of things, in words."""


def counted(number: int, noun: str) -> str:
    """A number and what is counted: the noun, or its plural with an s.

    Examples
    --------
    >>> counted(1, "sound"), counted(0, "sound"), counted(1200, "sound")
    ('1 sound', '0 sounds', '1,200 sounds')
    """
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"
