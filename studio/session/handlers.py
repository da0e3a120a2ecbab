"""What pages may ask the studio to do: a function a call, which checks what it is given."""

import inspect
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import make_dataclass, replace
from functools import cache
from typing import Annotated, Any, TypedDict, Unpack, get_args, get_type_hints

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.fem.geometry.surface import surface_name
from carillon.parameters.documents import require_values
from carillon.parameters.model import Within
from sound.project.project import Project
from studio.interface import NotFoundError
from studio.rows import KINDS
from studio.session.composing import add_row, change_row, move_row, paint, remove_row
from studio.session.document import Document, Target, merged, with_plain_lengths
from studio.session.examples import EXAMPLES
from studio.session.mesh_axes import mesh_document, moved_with_mesh
from studio.session.projects import fit_name, opened, save
from studio.session.state import StudioState

Text = Annotated[str, Within(max_length=1000)]
Vertex = Annotated[int, Within(ge=0), "a vertex of the surface"]
Comparison = Annotated[int, Within(ge=0), "a comparison, counted from 0"]
Score = Annotated[int, Within(ge=1, le=5), "1 (the first is definitely better) to 5"]


class TargetChanges(TypedDict, total=False):
    """Keys of a target that pages change."""

    vertex: Vertex
    name: Text
    clip: Text | None
    modes: int | None
    allow_clipped: bool
    without: Annotated[tuple[float, ...], Within(max_length=1000)]


def open_mesh(state: StudioState, mesh: Text, unit: float = 1.0) -> None:
    """Begin with a mesh: `builtin:NAME`, or one that was uploaded."""
    file = mesh if mesh.startswith(BUILTIN_PREFIX) else state.meshes.get(mesh)
    if file is None:
        raise NotFoundError(f"there is no mesh {mesh!r}; add it again")
    state.open(
        fit_name(surface_name(file)), mesh_document(file, {} if unit == 1.0 else {"unit": unit})
    )


def open_project(state: StudioState, project: Text) -> None:
    """Begin with an example (`e1`) or a project of the workspace (`p1`)."""
    kind, number = project[:1], project[1:]
    workspace = state.workspace
    listed = {"e": EXAMPLES, "p": workspace.projects()}.get(kind, ())
    if not (number.isascii() and number.isdigit() and 1 <= int(number) <= len(listed)):
        raise NotFoundError(f"there is no project {project!r}; see which ones are listed")
    if kind == "e":
        example = EXAMPLES[int(number) - 1]
        state.open(example.name, example.open(workspace))
        return
    name = workspace.projects()[int(number) - 1]
    document = opened(workspace, name)
    state.open(name, document)
    state.saved = state.document


def add_target(
    state: StudioState, vertex: Vertex, name: Text | None = None, clip: Text | None = None
) -> None:
    """Place a target on a vertex of the surface."""
    document = state.document
    _require_free(state, vertex)
    named = name if name is not None else _free_name(document)
    target = Target(named, vertex=vertex, clip=_file(state, clip))
    changed = replace(document, targets=(*document.targets, target))
    state.do(f"add target {named}", changed)


def change_target(state: StudioState, target: Text, **changes: Unpack[TargetChanges]) -> None:
    """Change keys of a target."""
    document = state.document
    before = document.target(target)
    if "clip" in changes:
        changes["clip"] = _file(state, changes["clip"])
        if changes["clip"] != before.clip:
            changes.setdefault("without", ())
    if changes.get("vertex") is not None:
        _require_free(state, changes["vertex"], target)
        before = replace(before, at=None)
    if "without" in changes:
        changes["without"] = tuple(changes["without"])
    changed = document.with_target(target, replace(before, **changes))
    state.do(f"change target {target}", changed)


def remove_target(state: StudioState, target: Text) -> None:
    """Remove a target."""
    changed = state.document.with_target(target, None)
    state.do(f"remove target {target}", changed)


def stop_extraction(state: StudioState, clip: Text) -> None:
    """End the search for a clip's modes."""
    state.clips.stop(clip)


def extract_again(state: StudioState, clip: Text) -> None:
    """Find the modes of a clip whose search was stopped."""
    state.clips.begin_again(clip)


def change_settings(state: StudioState, settings: dict[str, Any]) -> None:
    """Change keys of the project but its targets, regions and supports."""
    require_values(settings, Project, leave_out=("mesh", "targets", *KINDS))
    if settings.get("forest") is not None:
        state.workspace.path(settings["forest"])
    document, settings = state.document, with_plain_lengths(settings)
    moved = moved_with_mesh(document, state.solid.strikes, settings)
    changed = replace(moved, settings=merged(moved.settings, settings))
    state.do("change settings", changed)


def undo(state: StudioState) -> None:
    """Undo the last step."""
    state.move(forwards=False)


def redo(state: StudioState) -> None:
    """Do again what was undone."""
    state.move(forwards=True)


def forget_material(state: StudioState) -> None:
    """Go back to the uniform material."""
    state.do("forget material", replace(state.document, material=None))


def fine(state: StudioState, on: bool) -> None:
    """Show the fine solid, or the one of the search."""
    state.shows_fine = bool(on)
    state.changed_and_woken()


def keep(state: StudioState) -> None:
    """Keep the present material as A, and go on with B."""
    document = state.document
    if document.mesh is None:
        raise UserError("there is no solid yet whose material could be kept; open one first")
    kept = replace(document, kept=document.material, heard="B")
    state.do("keep material", kept)


def swap(state: StudioState) -> None:
    """Exchange the materials A and B."""
    document = state.document
    if document.heard is None:
        raise UserError("no material is kept yet; keep one first")
    other = "B" if document.heard == "A" else "A"
    swapped = replace(document, material=document.kept, kept=document.material, heard=other)
    state.is_searching = False
    state.do("swap materials", swapped)


def look_for_heads(state: StudioState) -> None:
    """See which folders of the workspace have measured heads."""
    state.heads.look()


async def open_heads(state: StudioState, folder: Text, anew: bool = False) -> None:
    """Read the heads of a folder of the workspace, and go on with its calibration."""
    await state.heads.open(folder, anew)


async def compare_heads(state: StudioState, number: Comparison, score: Score) -> None:
    """Say which of the pair of a comparison is nearer to the direction."""
    await state.heads.answer(number, score)


async def write_blend(state: StudioState) -> None:
    """Write the blend of heads that is preferred at present."""
    await state.heads.write_blend()


HANDLERS: Mapping[str, Callable[..., Awaitable[None] | None]] = {
    "open_mesh": open_mesh,
    "open_project": open_project,
    "save": save,
    "add_target": add_target,
    "change_target": change_target,
    "remove_target": remove_target,
    "stop_extraction": stop_extraction,
    "extract_again": extract_again,
    "add_row": add_row,
    "change_row": change_row,
    "remove_row": remove_row,
    "move_row": move_row,
    "paint": paint,
    "change_settings": change_settings,
    "optimise": StudioState.begin_search,
    "stop": StudioState.stop_search,
    "undo": undo,
    "redo": redo,
    "forget_material": forget_material,
    "fine": fine,
    "keep": keep,
    "swap": swap,
    "look_for_heads": look_for_heads,
    "open_heads": open_heads,
    "compare_heads": compare_heads,
    "write_blend": write_blend,
}
"""What the page may call: functions of a state and of the call's keys, by the call's name."""


async def handle(state: StudioState, name: str, arguments: Mapping[str, Any]) -> None:
    """Do what a page asks for.

    Raises UserError as `require_call` does, or with one sentence if it cannot be done.
    """
    require_call(name, arguments)
    under_way = HANDLERS[name](state, **arguments)
    if under_way is not None:
        await under_way


def require_call(name: str, arguments: Mapping[str, Any]) -> None:
    """Check the name of a call, and its keys against the signature of its function.

    Raises UserError if there is no such call, a key is missing or unknown, or a value is of another
    kind.
    """
    if name not in HANDLERS:
        raise UserError(f"there is no call {name!r:.100}; expected one of {', '.join(HANDLERS)}")
    model, needed = _keys(HANDLERS[name])
    for key in needed:
        if key not in arguments:
            raise UserError(f"{name}: lacks {key!r}")
    try:
        require_values(arguments, model)
    except UserError as error:
        raise UserError(f"{name}: {error}") from None


@cache
def _keys(handler: Callable[..., Any]) -> tuple[type, list[str]]:
    """A call's keys as the fields of a dataclass, and those of them that have to be there."""
    _, *parameters = inspect.signature(handler, eval_str=True).parameters.values()
    known: dict[str, Any] = {}
    for each in parameters:
        if each.kind is each.VAR_KEYWORD:
            known |= get_type_hints(get_args(each.annotation)[0], include_extras=True)
        else:
            known[each.name] = each.annotation
    needed = [each.name for each in parameters if each.default is each.empty]
    return make_dataclass("Keys", known.items()), [name for name in needed if name in known]


def _file(state: StudioState, clip: str | None) -> str | None:
    return None if clip is None else state.clips.named(clip).file


def _require_free(state: StudioState, vertex: int, target: str | None = None) -> None:
    bench = state.solid
    count = None if bench.news is None else bench.news.vertices
    if count is None:
        raise UserError("there is no solid yet to place a target on; open one first")
    if not isinstance(vertex, int) or not 0 <= vertex < count:
        raise UserError(f"there is no vertex {vertex!r}, the surface has {count:,} of them")
    for other in state.document.targets:
        strike = bench.strikes.get(other.name)
        taken = other.vertex if strike is None else strike.vertex
        if taken == vertex and other.name != target:
            raise UserError(f"the target {other.name!r} is at this point; choose another")


def _free_name(document: Document) -> str:
    names = {target.name for target in document.targets}
    return next(name for k in range(1, 1000) if (name := f"target {k}") not in names)
