"""Notebooks of the examples: without outputs, of the public surface alone, pages, and they run."""

import ast
import json

import nbformat
import notebooks
import pytest
from places import PLACE

from tests.documentation import DOCS
from tests.notebooks import cells
from tests.programs import checkout_environment, python

ROOMS = {"dataset_gen", "forests", "solver", "sound", "studio", "studies", "workflow"}

EACH = pytest.mark.parametrize("notebook", notebooks.notebooks(), ids=lambda each: each.stem)


@EACH
def test_a_notebook_is_one_and_holds_no_outputs(notebook):
    content = json.loads(notebook.read_text())
    nbformat.validate(content)
    code = [cell for cell in content["cells"] if cell["cell_type"] == "code"]
    assert code and all(not cell["outputs"] and cell["execution_count"] is None for cell in code)
    assert set(content["metadata"]) <= {"kernelspec", "language_info"}


@EACH
def test_a_notebook_uses_the_public_surface_alone(notebook):
    for source in cells(notebook, "code"):
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Import | ast.ImportFrom):
                named = [alias.name for alias in node.names]
                named += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                assert ROOMS.isdisjoint(named)
                assert not any(name.startswith("carillon.") for name in named)


@EACH
def test_a_notebook_is_a_page(notebook):
    found = {page: PLACE.search(page.read_text()) for page in DOCS.glob("tutorials/*.md")}
    places = {page: place for page, place in found.items() if place}
    pages = [page for page in places if places[page][1] == f"notebook {notebook.stem}"]
    assert len(pages) == 1
    assert places[pages[0]][2] == f"build/docs/tutorials/{pages[0].stem}.html"
    assert f"tutorials/{pages[0].stem}\n" in (DOCS / "index.md").read_text()
    made = notebooks.of_notebook(notebook.stem)
    assert made.startswith("# ") and all(source in made for source in cells(notebook, "code"))
    for link in (part.partition(")")[0] for part in made.split("](")[1:]):
        assert (DOCS / "tutorials" / link.partition("#")[0]).resolve().is_file(), link


RESULTS = {
    "a_spectrum_you_can_trust": ["no mode is missing, by inertia", "Audit: no fault"],
    "design_a_sound": ["Clip of 4 modes", "Design of bar", "like the clip; 4 partials"],
}
"""What the pages of the notebooks tell, as their texts say."""


@pytest.mark.nightly
@EACH
def test_a_notebook_runs_and_shows_what_it_says(notebook, tmp_path):
    environment = checkout_environment()
    page = tmp_path / "page.html"
    done = python("-m", "tests.notebooks", notebook, page, cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    assert "no picture" not in text
    assert all(part in text for part in RESULTS[notebook.stem])
