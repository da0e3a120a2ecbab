"""Every command of the README and of all pages but that on sound runs as it stands there."""

import pytest

from tests.documentation import CHECKOUT, PAGES, SOUND, Reader, has_commands

# Those about sound have a file of their own, which another process may run meanwhile.
RUN = [page for page in PAGES if has_commands(page) and page != SOUND]


@pytest.fixture(scope="module")
def reader(tmp_path_factory) -> Reader:
    return Reader(tmp_path_factory.mktemp("reader"))


@pytest.mark.nightly
@pytest.mark.mpi
@pytest.mark.parametrize("page", RUN, ids=lambda page: str(page.relative_to(CHECKOUT)))
def test_commands_of_a_page_run(reader, page):
    assert reader.follow(page)


@pytest.mark.nightly
def test_the_example_of_the_readme_prints_frequencies(reader):
    *_, frequencies = reader.follow(CHECKOUT / "README.md")
    assert len(frequencies.strip("[]\n").split()) == 34
