"""What a studio begins with: a file, a solid, or what it was left with."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.command_line.progress import say
from carillon.errors import UserError, one_line
from carillon.fem.geometry.surface import surface_name
from carillon.files.hdf5 import kind_of
from carillon.limits import MESH_BYTES
from carillon.parameters.documents import parameters_from
from sound.project.design_file import read_design
from sound.project.project import Project
from studio.session.document import Document, document_of, files_of
from studio.session.handlers import change_settings
from studio.session.mesh_axes import mesh_document
from studio.session.projects import fit_name, opened, with_design
from studio.session.restoring import NONSENSE
from studio.session.snapshot import restore
from studio.session.studio import DesignStudio
from studio.session.workspace import OWN_FOLDER, PROJECT_ENDINGS, SESSION, OutsideError, Workspace

DESIGN_ENDINGS = (".h5", ".hdf5")
UNTITLED = "untitled"


def open_studio(
    what: str | None, folder: Path, settings: Mapping[str, Any] | None = None
) -> DesignStudio:
    """A studio in a folder, which goes on with what it was left with there, if that is asked for.

    It begins with a project, a mesh or a design in the folder, or `builtin:NAME`; with None, with
    what it was left with.  `settings` are those of the mesh that is opened: how large it is, what
    points up, and its wall.  Raises UserError if that cannot be opened, another studio works in the
    folder, what it was left with names files outside of the folder, or settings are given and no
    mesh is opened.
    """
    if settings and (what is None or not _is_mesh(what)):
        raise UserError(
            f"found {', '.join(f'--{key}' for key in settings if key != 'discretisation')} and no "
            "mesh; a project or a design says so itself, and the page asks for it"
        )
    workspace = Workspace(folder)
    try:
        name, document = _begun(what, workspace, settings or {})
        session = workspace.read_session()
        studio = DesignStudio(workspace, name, document)
        if session is not None and _goes_on(session, what, name):
            _go_on(studio, session)
        state = studio.session
        if settings and any(state.document.settings.get(key) != settings[key] for key in settings):
            change_settings(state, dict(settings))
        return studio
    except BaseException:
        workspace.close()
        raise


def _is_mesh(what: str) -> bool:
    return Path(what).suffix.lower() not in (*PROJECT_ENDINGS, *DESIGN_ENDINGS)


def _goes_on(session: Mapping[str, Any], what: str | None, name: str) -> bool:
    """Whether to go on with a session; what was saved is read, others may have changed it."""
    is_under_way = session.get("searching") or not session.get("saved")
    return what is None or bool(session.get("name") == name and is_under_way)


def _go_on(studio: DesignStudio, session: Mapping[str, Any]) -> None:
    file = studio.session.workspace.folder / OWN_FOLDER / SESSION
    try:
        restore(studio.session, session)
    except OutsideError as error:
        raise UserError(
            f"{file}: what the studio was left with names files that are not its own ({error}); "
            "remove this file to begin anew"
        ) from None
    except NONSENSE as error:
        say(f"{file}: cannot be gone on with ({one_line(str(error))}), all begins anew")


def _begun(
    what: str | None, workspace: Workspace, settings: Mapping[str, Any]
) -> tuple[str, Document]:
    if what is None:
        return UNTITLED, Document({})
    if what.startswith(BUILTIN_PREFIX):
        name = surface_name(what)
        return fit_name(name), mesh_document(what, settings).require_sound(workspace.folder)
    path = Path(what)
    if not _is_file(path):
        raise UserError(
            f"{what}: no such file, expected a project (YAML), a mesh, a design (.h5) or "
            f"{BUILTIN_PREFIX}NAME"
        )
    file = _inside(path, workspace)
    if path.suffix.lower() in PROJECT_ENDINGS:
        if path.parent.resolve() != workspace.folder:
            raise UserError(
                f"{path}: lies in a folder below the workspace {workspace.folder}, expected a "
                "project directly in it; leave --workspace out"
            )
        return path.stem, opened(workspace, path.stem)
    if path.suffix.lower() in DESIGN_ENDINGS:
        return path.stem, _of_design(path, workspace)
    return fit_name(path.stem), mesh_document(file, settings).require_sound(workspace.folder)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long, or a null byte
        return False


def _inside(path: Path, workspace: Workspace) -> str:
    """The path of a file from the workspace's folder, in which it is copied if it is elsewhere."""
    resolved = path.resolve()
    if resolved.is_relative_to(workspace.folder):
        return str(resolved.relative_to(workspace.folder))
    if path.suffix.lower() in (*PROJECT_ENDINGS, *DESIGN_ENDINGS):
        raise UserError(
            f"{path}: lies outside of the workspace {workspace.folder}, expected a file in it; "
            "leave --workspace out, or copy it and what it names"
        )
    size = path.stat().st_size
    if size > MESH_BYTES:
        raise UserError(f"{path}: {size:,} bytes, expected a mesh of at most {MESH_BYTES:,}")
    return workspace.put(path.name, path.read_bytes())


def _of_design(path: Path, workspace: Workspace) -> Document:
    """The project that a design was made for, with its material."""
    if kind_of(path, "a Carillon design (HDF5)")[0] != "design":
        raise UserError(f"{path}: is no design, expected one that carillon design wrote")
    settings = read_design(path).asked
    try:
        parameters_from(settings, Project)
    except UserError as error:
        raise UserError(
            f"{path}: tells no project that it was made for ({error}); open its project or its "
            "mesh instead"
        ) from None
    folder = workspace.folder
    for entry in (settings, *settings["targets"], *settings.get("regions", ())):
        for key in ("mesh", "forest", "clip", "labels"):
            if entry.get(key) is not None and not entry[key].startswith(BUILTIN_PREFIX):
                entry[key] = _relative(entry[key], folder)
    document = document_of(settings)
    for file in files_of(document):
        workspace.path(file)
    return with_design(document.require_sound(folder), path.resolve())


def _relative(name: str, folder: Path) -> str:
    """The path of a file from a folder, where a design names it from where it was made."""
    for path in (Path(name), folder / name, folder / Path(name).name):
        with suppress(OSError, ValueError, RuntimeError):  # no name of a file
            resolved = path.resolve()
            if resolved.is_file() and resolved.is_relative_to(folder):
                return str(resolved.relative_to(folder))
    return name
