"""Colours of figures, and of the pages that show them."""

import re

INK, MUTED, FAINT = "#23211d", "#6f6a60", "#dedad1"
"""Text and truth, axes, grid."""

COLOURS = {
    "truth": INK,
    "ddfem_slepc": "#7a6a9c",
    "hcms": "#8a94a0",
    "hcms_ec": "#1f7a6d",
    "fastest": "#3a6ea5",
    "ddfem_hcms_ec_accurate": "#8fb3a6",
    "ddfem_hcms_ec": "#b8641b",
    "random": "#b03a5b",
}
"""Colour of each variant, the same in all figures and on the page."""

THEMED = {
    INK: "--ink",
    MUTED: "--muted",
    FAINT: "--faint",
    **{colour: f"--{name.replace('_', '-')}" for name, colour in COLOURS.items() if colour != INK},
}
"""Style-sheet variables that take the place of colours on the page, so that figures follow it into
the dark."""


def themed(source: str) -> str:
    """Replace colours and fonts of an SVG by style-sheet variables, which only a page defines."""
    for colour, variable in THEMED.items():
        source = re.sub(colour, f"var({variable})", source, flags=re.IGNORECASE)
    return re.sub(r"font-family: [^;\"]*", "font-family: var(--sans)", source)
