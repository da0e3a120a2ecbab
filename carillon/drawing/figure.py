"""A figure that a notebook shows, whether or not pyplot has been loaded."""

import io

from matplotlib.figure import Figure


class ShownFigure(Figure):
    """A figure whose picture is a PNG file."""

    def _repr_png_(self) -> bytes:
        content = io.BytesIO()
        self.savefig(content, format="png", dpi=80)
        return content.getvalue()
