"""The pages hang together: links, contents, marks of blocks, and the parts made from sources."""

import importlib
import inspect
import re
from pathlib import Path

import command_help
import places
import pytest

from carillon import ROOMS
from carillon.__main__ import STUDY, commands, studies
from studies.base import catalogue
from tests.documentation import CHECKOUT, DOCS, PAGES, PROSE, RUN, blocks, page_before, prose

EACH = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(CHECKOUT)))
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchor(heading: str) -> str:
    """Anchor of a heading, as GitHub and MyST make it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def anchors(page: Path) -> set[str]:
    return {anchor(found) for found in re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)}


def contents(page: Path) -> list[Path]:
    """Pages that the tables of contents of a page name."""
    lines = [
        line
        for block in blocks(page)
        if block.language == "{toctree}"
        for line in block.text.splitlines()
    ]
    return [page.parent / f"{line}.md" for line in lines if line and not line.startswith(":")]


@EACH
def test_links_lead_somewhere(page):
    for target in LINK.findall(prose(page)):
        if "://" in target:
            continue
        path, _, part = target.partition("#")
        linked = (page.parent / path).resolve() if path else page
        assert linked.exists(), target
        assert not part or part in anchors(linked), target


@EACH
def test_files_that_a_page_names_exist(page):
    for path in re.findall(r"`((?:workflow|docs|slurm|tests|forests)/[^`* ]+)`", prose(page)):
        assert (CHECKOUT / path).exists(), path


@EACH
def test_pages_stay_inside_the_documentation(page):
    """What is linked from a page of the site is in the site; the README is read elsewhere."""
    if page.is_relative_to(DOCS):
        for target in LINK.findall(prose(page)):
            path = target.partition("#")[0]
            if path and "://" not in target:
                assert (page.parent / path).resolve().is_relative_to(DOCS), target


@EACH
def test_blocks_are_run_read_or_marked(page):
    for block in blocks(page):
        assert block.language in (*RUN, *PROSE), block.language


def test_every_page_stands_in_the_contents_once():
    named, open_pages = [], [DOCS / "index.md"]
    while open_pages:
        below = contents(open_pages.pop())
        named += below
        open_pages += below
    assert sorted(named) == sorted(set(PAGES) - {CHECKOUT / "README.md", DOCS / "index.md"})


def test_pages_go_on_from_pages():
    before = [found for found in map(page_before, PAGES) if found is not None]
    assert before and set(before) <= set(PAGES)


def test_included_files_exist():
    for page in PAGES:
        for target in re.findall(r"^```\{include\} (\S+)$", page.read_text(), re.MULTILINE):
            assert (page.parent / target).exists(), target


def test_make_targets_exist():
    named = set(re.findall(r"[`(\n]make ([a-z]+)", "\n".join(page.read_text() for page in PAGES)))
    targets = set(re.findall(r"^([a-z]+):", (CHECKOUT / "Makefile").read_text(), re.MULTILINE))
    assert {"run", "test", "env", "check", "docs"} <= named <= targets


@EACH
def test_parts_that_are_made_are_named_with_where_they_will_be(page):
    for _, place in places.PLACE.findall(page.read_text()):
        html = page.relative_to(DOCS).with_suffix(".html")
        assert place == f"build/docs/{html}"


def test_the_readme_is_short():
    assert len((CHECKOUT / "README.md").read_text().splitlines()) <= 180


def test_every_command_has_its_help_on_a_page():
    text = "\n".join(
        (DOCS / "reference" / "commands" / f"{page}.md").read_text()
        for page in ("index", *ROOMS[1:])
    )
    made = [name.split() for name, _ in places.PLACE.findall(text)]
    rooms = [words[1] for words in made if words[0] == "commands"]
    headings = re.findall(
        r"^## `carillon ([^`]+)`$", "\n".join(map(command_help.of_room, rooms)), re.M
    )
    every = {*commands(), *(f"{STUDY} {name}" for name in studies())} - {STUDY}
    assert sorted(headings) == sorted(every)


def in_code(pattern: str) -> list[tuple[Path, str]]:
    """What a pattern finds in the code within sentences, with its page."""
    codes = [(page, code) for page in PAGES for code in re.findall(r"`([^`\n]+)`", prose(page))]
    return [(page, text) for page, code in codes for text in re.findall(pattern, code)]


OTHERS = {"--mpi", "--unlock", "--snakefile", "--directory", "--oversubscribe"} | {
    *("--tier", "--durations", "--measured")
}
"""Options of other programs that pages name."""


def test_options_that_pages_name_exist():
    known = {*re.findall(r"--[a-z][a-z-]*", "\n".join(map(command_help.of_room, ROOMS))), *OTHERS}
    for page, option in in_code(r"(?<![\w-])--[a-z][a-z-]*"):
        # Any option may be shortened.
        assert any(each.startswith(option) for each in known), (page.name, option)


def test_commands_that_pages_name_exist():
    known = {*commands(), *studies()}
    for page, name in in_code(r"(?:^|/)carillon ([a-z][a-z-]*)"):
        assert name in known, (page.name, name)


def test_targets_that_pages_name_exist():
    rules = [*CHECKOUT.glob("workflow/rules/*.smk"), *CHECKOUT.glob("studies/*/*.smk")]
    known = {name for file in rules for name in re.findall(r"^rule (\w+):", file.read_text(), re.M)}
    known |= {study.name for study in catalogue.all_studies().values() if study.target}
    for page, name in in_code(r"^(?:\S*/)?snakemake (?:--cores \d+ )?([a-z]\w+)$"):
        assert name in known, (page.name, name)


def test_public_functions_have_an_example():
    page = (DOCS / "reference" / "api.md").read_text()
    module = ""
    for line in page.splitlines():
        if line.startswith(".. currentmodule:: "):
            module = line.split()[-1]
        if line.startswith(".. autofunction:: "):
            name = line.split()[-1]
            place, _, function = name.rpartition(".") if "." in name else (module, "", name)
            found = getattr(importlib.import_module(place), function)
            assert ">>>" in (inspect.getdoc(found) or ""), name
