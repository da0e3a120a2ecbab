"""Files of the page: a table made at the start, from which alone is served."""

import base64
import hashlib
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response

PAGE = Path(__file__).resolve().parent.parent / "page"
"""Folder of the page."""
TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".png": "image/png",
    ".svg": "image/svg+xml",
}
"""Media types of what is served, by ending."""
_MAP = re.compile(rb'<script type="importmap">(.*?)</script>', re.DOTALL)


def page_table(folder: Path = PAGE) -> Mapping[str, Path]:
    """Files of the page by their paths in requests."""
    return {f"/page/{path.relative_to(folder).as_posix()}": path for path in _files(folder)}


def _files(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.name == "node_modules" or path.is_symlink():
            continue
        if path.is_dir():
            yield from _files(path)
        elif path.suffix in TYPES:
            yield path


def send_file(request: Request, table: Mapping[str, Path]) -> Response | None:
    """The file that a request asks for; none if the table has no such path.

    Browsers keep it and ask each time whether it has changed.
    """
    path = table.get(request.scope["path"])
    if path is None:
        return None
    content = path.read_bytes()
    headers = {
        "ETag": f'"{hashlib.sha256(content).hexdigest()[:32]}"',
        "Cache-Control": "no-cache",
        # That of a script is its own where it runs beside the page.
        "Content-Security-Policy": page_policy(b""),
    }
    if request.headers.get("if-none-match") == headers["ETag"]:
        return Response(status_code=304, headers=headers)
    return Response(content, media_type=TYPES[path.suffix], headers=headers)


def send_page(folder: Path = PAGE) -> Response:
    """The page, with the policy that lets its own modules run and nothing else."""
    content = (folder / "index.html").read_bytes()
    headers = {"Content-Security-Policy": page_policy(content), "Cache-Control": "no-store"}
    return Response(content, media_type="text/html; charset=utf-8", headers=headers)


def page_policy(page: bytes) -> str:
    """Content security policy of a page, whose import map is the only script within it."""
    scripts = ["'self'"]
    for text in _MAP.findall(page):
        scripts.append(f"'sha256-{base64.b64encode(hashlib.sha256(text).digest()).decode()}'")
    return "; ".join(
        (
            "default-src 'self'",
            f"script-src {' '.join(scripts)}",
            "connect-src 'self'",
            "img-src 'self' blob: data:",
            "media-src 'self' blob:",
            "object-src 'none'",
            "base-uri 'none'",
            "frame-ancestors 'none'",
            "form-action 'none'",
        )
    )
