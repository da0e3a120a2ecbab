"""Names of files that commands write; the endings name the formats."""

from collections.abc import Iterable
from pathlib import Path

from carillon.errors import UserError
from carillon.files.paths import require_writable


def require_output(
    path: str | Path, endings: Iterable[str], inputs: Iterable[str | Path] = ()
) -> Path:
    """Check, before the work, that `path` can be written and has one of the endings (`.wav`).

    Raises UserError if it has another one, capitals aside, or is that of one of the command's
    inputs, or no file can be written there.
    """
    suffix = Path(path).suffix
    if suffix.lower() not in endings:
        raise UserError(
            f"{path}: ends in {suffix or 'nothing'}, expected a name that ends in "
            f"{' or '.join(endings)}, since that is what is written"
        )
    return require_writable(path, inputs)
