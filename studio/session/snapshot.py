"""The state of a studio as pages are told it, and as it is kept between two runs."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from carillon.fem.geometry.builtin import BUILTINS
from carillon.parameters.documents import with_defaults
from sound.project.project import Project
from studio.rows import KINDS, rows_of, told
from studio.session.examples import EXAMPLES
from studio.session.restoring import LONGEST_NAME, kept, restored
from studio.session.state import StudioState

ELSEWHERE = ("mesh", "targets", *KINDS)
"""Keys of a project that pages are not told as settings."""


def state_event(state: StudioState) -> dict[str, Any]:
    """The event `state`, as docs/contributing/studio.md describes it."""
    document, news = state.document, state.solid.news
    settings = with_defaults(document.settings, Project)
    # For the solid, or for clips.
    is_waiting = state.is_searching and state.search.phase == "idle"
    phase = "starting" if is_waiting else state.search.phase
    return {
        "event": "state",
        "revision": state.revision,
        "name": state.name,
        "saved": state.saved == document,
        "workspace": state.workspace.folder.name,
        "undo": state.history.undo_name,
        "redo": state.history.redo_name,
        "solid": None if news is None else asdict(news),
        "targets": [_target(state, each.name) for each in document.targets],
        "clips": state.clips.state(),
        "wanted": state.solid.wanted,
        "settings": {k: v for k, v in settings.items() if k not in ELSEWHERE},
        "composition": state.placing.number,
        **{kind: _rows(state, kind) for kind in KINDS},
        "search": {
            "phase": phase,
            "message": state.message,
        },
        "fine": {"on": state.shows_fine, "phase": state.fine_phase, "message": None},
        "heard": document.heard,
        "heads": state.heads.state(),
        "builtins": sorted(BUILTINS),
        "examples": [
            {"project": f"e{number}", "name": each.name, "says": each.says}
            for number, each in enumerate(EXAMPLES, start=1)
        ],
        "projects": [
            {"project": f"p{number}", "name": name}
            for number, name in enumerate(state.workspace.projects(), start=1)
        ],
    }


def _target(state: StudioState, name: str) -> dict[str, Any]:
    target, strike = state.document.target(name), state.solid.strikes.get(name)
    clip = None if target.clip is None else state.clips.add(target.clip).identifier
    return {
        "name": name,
        "vertex": target.vertex if strike is None else strike.vertex,
        "position_m": None if strike is None else strike.position.tolist(),
        "clip": clip,
        "modes": target.modes,
        "allow_clipped": target.allow_clipped,
        "without": list(target.without),
    }


def _rows(state: StudioState, kind: str) -> list[dict[str, Any]]:
    """Regions or supports, each with what is wrong with it."""
    news, faults = state.solid.news, state.placing.faults
    sentence = None if news is None else news.message
    rows = rows_of(state.document.settings, kind)
    return [
        told(row, kind, faults.get((kind, number)), sentence) for number, row in enumerate(rows)
    ]


def session_of(state: StudioState) -> dict[str, Any]:
    """What a studio goes on with when it is started again."""
    return {
        "name": state.name,
        "saved": state.saved == state.document,
        "searching": state.is_searching,
        "fine": state.shows_fine,
        "heads": state.heads.folder,
        "history": kept(state.history, state.workspace),
    }


def restore(state: StudioState, session: Mapping[str, Any]) -> None:
    """Let a studio go on with what `session_of` returned.

    Raises OutsideError if it names files outside of the workspace, and one of
    `studio.session.restoring.NONSENSE` if it is none.
    """
    name, history = session["name"], restored(session["history"], state.workspace)
    if not isinstance(name, str) or not 0 < len(name) <= LONGEST_NAME:
        raise ValueError("the name is none")
    heads = session.get("heads")
    if not (heads is None or isinstance(heads, str) and 0 < len(heads) <= LONGEST_NAME):
        raise ValueError("the folder of heads is none")
    saved, fine = bool(session["saved"]), bool(session["fine"])
    state.heads.folder = heads
    state.is_searching = bool(session["searching"])
    state.name, state.shows_fine = name, fine
    state.history, state.saved = history, history.document if saved else None
