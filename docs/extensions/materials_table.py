"""The materials of scenes as a table."""

from __future__ import annotations

from sound.scenes.materials import MATERIALS, named_material

_HEAD = (
    "| name | E [GPa] | ν | density [kg/m³] | α [1/s] | β [s] | bounce | friction "
    "| roughness [µm] | source |"
)


def of_materials() -> str:
    """A line for each."""
    rows = [_HEAD, "| --- |" + " ---: |" * 8 + " --- |"]
    for name in MATERIALS:
        each = named_material(name)
        numbers = [
            f"{each.young / 1e9:.3g}",
            f"{each.poisson:.3g}",
            f"{each.density:.4g}",
            f"{each.alpha:.3g}",
            f"{each.beta:.2g}",
            f"{each.restitution:.2g}",
            f"{each.friction:.2g}",
            f"{1e6 * each.roughness:.2g}",
        ]
        rows.append(f"| {name} | {' | '.join(numbers)} | {each.about}. {each.source} |")
    return "\n".join(rows) + "\n"
