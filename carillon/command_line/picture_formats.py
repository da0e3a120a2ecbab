"""Names of pictures: their endings choose the format."""

from __future__ import annotations

from pathlib import Path

from carillon.errors import UserError

FORMATS = (".png", ".svg", ".pdf")


def require_plottable(path: str | Path) -> Path:
    """Raise UserError unless `path` ends as a picture does."""
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise UserError(f"{path}: a picture's name ends with {', '.join(FORMATS)}")
    return path
