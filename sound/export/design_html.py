"""What a design shows of itself in a notebook: verdict, partials, sound, and the material."""

import numpy as np

from carillon.fem.geometry import HexMesh, hexmesh_from_grid
from carillon.notebook.card import Markup, card, table
from carillon.notebook.solid import solid
from carillon.notebook.voxels import voxel_triangles
from sound.clips.sound_html import sound_player
from sound.design.pitch import cents
from sound.project.design import Design
from sound.rendering.heard_solid import heard_design
from sound.rendering.render import Hit
from sound.rendering.rendered_sound import render_sound, ringing_seconds

MOST_ROWS = 12
"""Partials that the table lists, those that are furthest off."""
MOST_HEARD = 3
"""Targets that are struck."""
SECONDS = 3.0
"""Greatest length [s] of a strike that is played."""


def design_html(design: Design) -> str:
    """A card of a design."""
    facts = [sentence] if (sentence := verdict_of(design)) else []
    facts.append(summary(design))
    return card(
        f"Design of {design.name}", facts, _material(design), _partials(design), *_heard(design)
    )


def verdict_of(design: Design) -> str:
    """Whether it sounds like its clips, in words; empty if that is unknown."""
    return str((design.evidence.get("verdict") or {}).get("sentence", ""))


def summary(design: Design) -> str:
    """How far the partials are off the clips', in words."""
    which = design.targets.sounding
    off = np.abs(cents(design.frequencies, design.targets.frequencies)[which])
    partials = "1 partial" if len(off) == 1 else f"{len(off)} partials"
    return f"{partials}, {np.median(off):.2g} cents off (median), {off.max():.2g} at most"


def _partials(design: Design) -> Markup:
    which, aims = design.targets.sounding, design.targets.frequencies
    off = cents(design.frequencies, aims)
    worst = which[np.argsort(-np.abs(off[which]), kind="stable")[:MOST_ROWS]]
    rows = [
        (f"{aims[n]:,.1f}", f"{design.frequencies[n]:,.1f}", f"{round(off[n], 2) + 0.0:+.2f}")
        for n in np.sort(worst)
    ]
    more = len(which) - len(rows)
    note = f"and {more} that are nearer" if more else ""
    return table(("clip [Hz]", "design [Hz]", "cents"), rows, note)


def _material(design: Design) -> Markup:
    mesh: HexMesh = hexmesh_from_grid(design.fine_grid, design.fine_origin, design.fine_edge)
    # Cells of a mesh are in an order of their own.
    young = design.young_near(mesh.origin + mesh.edge * (mesh.grid + 0.5))
    low, high = 1e-9 * young.min(), 1e-9 * young.max()
    shown = voxel_triangles(mesh, young, up="z" if design.up else None)
    caption = f"Young's modulus, {low:.3g} (dark) to {high:.3g} GPa (light)"
    return solid(shown, "The material", caption=caption)


def _heard(design: Design) -> list[Markup]:
    heard = heard_design(design)
    seconds = min(SECONDS, ringing_seconds(heard.solid))
    players = []
    for strike in design.strikes[:MOST_HEARD]:
        hit = Hit(0.0, strike.position, strike.inward)  # 1 N s
        sound = render_sound(heard.solid, [hit], seconds, listening=heard.listening)
        label = f"struck at {strike.name}"
        players.append(sound_player(sound.samples, sound.rate, label))
    return players
