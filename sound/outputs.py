"""Files that commands write: endings of names, which name the formats, and samples of sounds."""

from collections.abc import Iterable
from pathlib import Path

from carillon.errors import UserError
from carillon.files.paths import require_writable
from carillon.parameters import option, parameters
from carillon.parameters.quantities import Seed
from sound.bounds import FLOAT_BITS, SampleBits


@parameters
class WavOptions:
    """Samples of a sound file that is written."""

    bits: SampleBits = option(
        FLOAT_BITS,
        "bits of a sample: 32 is a floating-point number, 16 and 24 are whole numbers with dither "
        "(default 32)",
        metavar="{16,24,32}",
    )
    dither_seed: Seed = option(0, "random numbers of the dither")


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
