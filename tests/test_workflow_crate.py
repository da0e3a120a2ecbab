"""Crates of runs: what is in them, what they say of it, and what cannot become one."""

import hashlib
import json
import os
import resource
import shutil
import zipfile
from pathlib import Path
from urllib.parse import unquote

import pytest
import yaml

import carillon as ca
from carillon.errors import UserError
from carillon.fem.geometry import builtin_surface
from carillon.records import provenance
from tests.programs import CHECKOUT
from workflow import settings
from workflow.__main__ import main
from workflow.crate.archive import write_archive
from workflow.crate.contents import SNAKEFILE, Role, results_of
from workflow.crate.graph import METADATA, README

SOLID = {"resolution": 12, "material": "smooth"}
MODELS = {"bar": SOLID | {"mesh": "my bar.obj"}, "plate": SOLID | {"mesh": "builtin:plate"}}
RUN = {"title": "Two bells & <b>", "results_dir": "my results", "mesh_folder": "meshes"}


@pytest.fixture
def results(tmp_path, monkeypatch) -> Path:
    """Folder of results of a small run, in the present folder."""
    monkeypatch.chdir(tmp_path)
    Path("meshes").mkdir()
    builtin_surface("bar").export("meshes/my bar.obj")
    folder = Path(RUN["results_dir"])
    (folder / "models" / "bar").mkdir(parents=True)
    (folder / "logs").mkdir()
    Path("run.yaml").write_text(yaml.safe_dump(RUN | {"models": MODELS}))
    config = settings.resolved(settings.complete(["run.yaml"]))
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    ca.generate(folder / "0.h5", 10)
    record = provenance.record({"mesh": "meshes/my bar.obj", "material": "smooth"})
    record["date"] = "2026-03-01T10:00:00+00:00"
    (folder / "models" / "bar" / "audit.json").write_text(json.dumps({"provenance": record}))
    (folder / "logs" / "0.log").write_text("done\n")
    (folder / "empty.csv").write_text("")
    (folder / ".hidden").write_text("of a writer that was killed")
    return folder


def crate(results: Path, *options: object) -> dict[str, bytes]:
    """Files of the crate that the command makes, by name."""
    assert main(["crate", str(results), *map(str, options), "--out", "run.zip"]) == 0
    with zipfile.ZipFile("run.zip") as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


def entities(files: dict[str, bytes]) -> dict[str, dict]:
    """Entities of the metadata by their identifiers."""
    graph = json.loads(files[METADATA])["@graph"]
    by_id = {entity["@id"]: entity for entity in graph}
    assert len(by_id) == len(graph)
    return by_id


def identifiers(value) -> list[str]:
    """Identifiers of one or several references."""
    return [each["@id"] for each in (value if isinstance(value, list) else [value])]


def write_record(path: Path, parameters: dict, **more: object) -> None:
    """Write a JSON result whose record has such parameters."""
    path.write_text(json.dumps({"provenance": provenance.record(parameters) | more}))


def test_the_crate_holds_rules_inputs_and_results_and_nothing_hidden(results):
    files = crate(results)
    assert files[SNAKEFILE] == (CHECKOUT / SNAKEFILE).read_bytes()
    assert files["inputs/my bar.obj"] == Path("meshes/my bar.obj").read_bytes()
    names = {f"results/{path.relative_to(results)}" for path in results.rglob("*.*")}
    assert {name for name in files if name.startswith("results/")} == names - {"results/.hidden"}


def test_length_and_checksum_of_every_file_are_told(results):
    files = crate(results)
    described = {
        unquote(name): each
        for name, each in entities(files).items()
        if "File" in each["@type"] and name != METADATA
    }
    assert set(described) == set(files) - {METADATA}
    for name, entity in described.items():
        assert entity["contentSize"] == str(len(files[name]))
        assert entity["sha256"] == hashlib.sha256(files[name]).hexdigest()


def test_every_reference_leads_to_an_entity_or_to_the_web(results):
    known = entities(crate(results))

    def references(value):
        if isinstance(value, list):
            for each in value:
                yield from references(each)
        elif isinstance(value, dict):
            yield value["@id"]

    found = {name for each in known.values() for part in each.values() for name in references(part)}
    assert all(name in known or name.startswith("https://") for name in found)


def test_the_run_leads_from_configuration_and_mesh_to_the_results(results):
    known = entities(crate(results))
    run = known["#run"]
    assert identifiers(run["instrument"]) == [SNAKEFILE] == identifiers(known["./"]["mainEntity"])
    assert set(identifiers(run["object"])) == {"results/config.yaml", "inputs/my%20bar.obj"}
    assert "results/0.h5" in identifiers(run["result"])
    assert "results/logs/0.log" not in identifiers(run["result"])
    assert identifiers(known["results/logs/0.log"]["about"]) == ["#run"]
    assert known["inputs/my%20bar.obj"]["alternateName"] == "meshes/my bar.obj"


def test_a_result_leads_to_the_command_and_versions_that_made_it(results):
    known = entities(crate(results))
    action = known["#made-results/models/bar/audit.json"]
    record = json.loads((results / "models" / "bar" / "audit.json").read_text())["provenance"]
    assert record["command"] in action["description"] and record["commit"] in action["description"]
    assert action["endTime"] == record["date"]
    (software,) = (known[name] for name in identifiers(action["instrument"]))
    assert software["softwareVersion"] == ca.__version__
    needed = [known[name] for name in identifiers(software["softwareRequirements"])]
    told = {each["name"]: each["softwareVersion"] for each in needed}
    assert {"carillon": ca.__version__, **told} == provenance.versions()


def test_authors_and_licence_are_those_of_the_citation(results):
    known = entities(crate(results))
    citation = yaml.safe_load((CHECKOUT / "CITATION.cff").read_text())
    for name in ("./", SNAKEFILE):
        (author,) = (known[each] for each in identifiers(known[name]["author"]))
        assert (author["@type"], author["name"]) == ("Organization", citation["authors"][0]["name"])
        (licence,) = identifiers(known[name]["license"])
        assert licence == f"https://spdx.org/licenses/{citation['license']}"


def test_a_run_of_somebody_else_names_its_creator_and_licence(results):
    known = entities(crate(results, "--creator", "Ada Lovelace", "--licence", "CC-BY-4.0"))
    (creator,) = (known[each] for each in identifiers(known["./"]["author"]))
    assert (creator["@type"], creator["name"]) == ("Person", "Ada Lovelace")
    assert identifiers(known["./"]["license"]) == ["https://spdx.org/licenses/CC-BY-4.0"]
    (author,) = (known[each] for each in identifiers(known[SNAKEFILE]["author"]))
    assert author["name"] == "The Carillon developers"


@pytest.mark.parametrize("name", ["run", "configfile", "results_dir", "The Carillon developers"])
def test_creators_have_any_name(results, name):
    known = entities(crate(results, "--creator", name))
    (creator,) = (known[each] for each in identifiers(known["./"]["creator"]))
    assert (creator["@type"], creator["name"]) == ("Person", name)
    (author,) = (known[each] for each in identifiers(known[SNAKEFILE]["author"]))
    assert author["@type"] == "Organization"
    assert known["#run"]["@type"] == "CreateAction"
    parameters = {each["name"] for each in known.values() if each["@type"] == "FormalParameter"}
    assert parameters == {"configfile", "files of models", "results_dir"}


def test_the_page_for_people_says_what_to_cite(results):
    page = crate(results, "--licence", "CC-BY-4.0")[README].decode()
    assert page.startswith("# Two bells & \\<b\\>\n")
    for words in ("CC-BY-4.0", f"Carillon {ca.__version__}", "Kazuhiko Yamamoto", "2016"):
        assert words in page


def test_what_is_left_out_is_not_in_the_crate(results):
    files = crate(results, "--leave-out", "0.h5", "logs")
    assert not {"results/0.h5", "results/logs/0.log"} & (set(files) | set(entities(files)))


def test_the_same_results_make_the_same_bytes_again(results):
    crate(results)
    first = Path("run.zip").read_bytes()
    crate(results)
    assert Path("run.zip").read_bytes() == first


def test_dates_beyond_those_of_zip_files_do_not_matter(results):
    os.utime(results / "empty.csv", (0, 0))
    os.utime(results / "0.h5", (1 << 33, 1 << 33))
    assert {"results/empty.csv", "results/0.h5"} <= set(crate(results))


def test_a_crate_among_the_results_is_not_part_of_the_next(results):
    out = results / "run.zip"
    for _ in range(2):
        assert main(["crate", str(results), "--out", str(out)]) == 0
        with zipfile.ZipFile(out) as archive:
            assert "results/run.zip" not in archive.namelist()


def test_earlier_crates_are_no_results(results):
    shutil.copy("meshes/my bar.obj", results / "my results.crate.zip")
    assert not any(name.endswith(".crate.zip") for name in crate(results))


def test_what_the_run_has_made_itself_is_no_input(results):
    write_record(results / "of_box.json", {"mesh": str(results / "box.obj")})
    shutil.copy("meshes/my bar.obj", results / "box.obj")
    assert "inputs/box.obj" not in crate(results)


def test_inputs_are_told_by_name_as_the_results_of_others_may_name_any_file(results, capsys):
    crate(results)
    assert capsys.readouterr().out.splitlines()[-1] == "inputs: meshes/my bar.obj"


@pytest.mark.parametrize("name", ["my bar", "My Bar"])
def test_inputs_of_one_name_in_any_case_are_all_in_the_crate(results, name):
    Path("other").mkdir()
    Path(f"other/{name}.obj").write_bytes(b"v 0 0 0\n")
    write_record(results / "of_other.json", {"mesh": f"other/{name}.obj"})
    files = crate(results)
    assert files[f"inputs/{name}-2.obj"] == b"v 0 0 0\n" and "inputs/my bar.obj" in files


def test_names_that_are_no_text_are_escaped(results):
    folder = Path(os.fsdecode(b"d\xff"))
    folder.mkdir()
    (folder / "box.obj").write_bytes(b"v 0 0 0\n")
    command = f"carillon modes {folder}/box.obj"
    write_record(
        results / "of_box.json", {"mesh": f"{folder}/box.obj"}, command=command, commit="\ud800"
    )
    known = entities(crate(results))
    assert known["inputs/box.obj"]["alternateName"] == r"d\udcff/box.obj"
    told = known["#made-results/of_box.json"]["description"]
    assert r"d\udcff/box.obj" in told and r"commit \ud800" in told


def test_folders_of_absolute_paths_are_not_told_of_inputs(results, tmp_path):
    home = tmp_path / "home of ada"
    home.mkdir()
    (home / "box.obj").write_bytes(b"v 0 0 0\n")
    write_record(results / "of_box.json", {"mesh": str(home / "box.obj")}, command="carillon")
    files = crate(results)
    assert entities(files)["inputs/box.obj"]["alternateName"] == "box.obj"
    assert home.name not in files[METADATA].decode()


def test_roles_follow_the_folders(results):
    roles = {part.name: part.role for part in results_of(results)}
    assert roles["results/config.yaml"] is Role.CONFIGURATION
    assert roles["results/logs/0.log"] is Role.TRACE
    assert roles["results/models/bar/audit.json"] is Role.RESULT


def _without_configuration(results: Path) -> None:
    (results / "config.yaml").unlink()


def _without_results(results: Path) -> None:
    for path in results.rglob("*.*"):
        if path.name != "config.yaml" and path.parent.name != "logs":
            path.unlink()


def _without_mesh(results: Path) -> None:
    Path("meshes/my bar.obj").unlink()


def _of_a_lost_mesh(results: Path) -> None:
    write_record(results / "of_lost.json", {"mesh": "lost.obj"})


def _of_a_folder(results: Path) -> None:
    write_record(results / "of_folder.json", {"mesh": "meshes"})


def _of_an_odd_name(results: Path) -> None:
    Path("a\nb.obj").write_bytes(b"v 0 0 0\n")
    write_record(results / "of_odd.json", {"mesh": "a\nb.obj"})


def _of_no_name(results: Path) -> None:
    write_record(results / "of_none.json", {"mesh": "\ud800.obj"})


def _with_a_link(results: Path) -> None:
    (results / "secret.txt").symlink_to("/etc/hostname")


def _with_a_linked_folder(results: Path) -> None:
    (results / "elsewhere").symlink_to("/etc")


def _damaged(results: Path) -> None:
    path = results / "0.h5"
    path.write_bytes(path.read_bytes()[:-100])


def _with_a_mistake(results: Path) -> None:
    (results / "config.yaml").write_text("models: 3\n")


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (shutil.rmtree, "my results: is no folder"),
        (_without_configuration, "holds no config.yaml"),
        (_without_results, "holds no results but config.yaml"),
        (_without_mesh, "config.yaml names meshes/my bar.obj: no such file, expected an"),
        (
            _of_a_lost_mesh,
            "my results/of_lost.json names lost.obj: no such file, expected an input",
        ),
        (_of_a_folder, "my results/of_folder.json names meshes: is a folder, expected an input"),
        (_of_an_odd_name, "my results/of_odd.json names 'a\\nb.obj': holds line breaks"),
        (_of_no_name, "my results/of_none.json names "),
        (_with_a_link, "secret.txt: is a link"),
        (_with_a_linked_folder, "elsewhere: is a link"),
        (_damaged, "0.h5: "),
        (_with_a_mistake, "config.yaml, line 1: "),
    ],
)
def test_what_cannot_be_a_crate_is_told_in_a_sentence_and_nothing_is_left(
    results, spoil, sentence, capsys
):
    spoil(results)
    before = sorted(Path().rglob("*"))
    assert main(["crate", str(results)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert sentence in said
    assert sorted(Path().rglob("*")) == before


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--out", "run.tar"], "run.tar: a crate is a ZIP file"),
        (["--out", "run.zip/"], "run.zip/: names a folder"),
        (["--out", "nowhere/run.zip"], "nowhere does not exist"),
        (["--licence", "my own"], "--licence: found 'my own'"),
        (["--creator", " "], "--creator: found ' '"),
        (["--leave-out", "../meshes"], "--leave-out ../meshes: there is no such"),
        (["--leave-out", "nothing"], "--leave-out nothing: there is no such"),
        (["--leave-out", "logs", "./config.yaml"], "which every crate holds"),
    ],
)
def test_options_that_make_no_sense_are_told(results, options, sentence, capsys):
    assert main(["crate", str(results), *options]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert sentence in said
    assert not list(Path().glob("*.zip"))


def test_a_file_that_vanishes_while_it_is_copied_leaves_no_crate(results, monkeypatch):
    from workflow.crate import archive

    copied = archive._copies

    def vanish(*arguments):
        (results / "empty.csv").unlink()
        yield from copied(*arguments)

    monkeypatch.setattr(archive, "_copies", vanish)
    parts = results_of(results)
    with pytest.raises(UserError, match=r"empty\.csv: cannot be copied"):
        archive.write_archive(Path("run.zip"), parts, lambda files: {})
    assert not list(Path().glob("*zip*"))


def test_a_full_disk_is_told_of_the_archive(results):
    parts = results_of(results)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        with pytest.raises(UserError, match=r"^run\.zip: could not be written \(.*make room"):
            write_archive(Path("run.zip"), parts, lambda files: {})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(Path().glob("*zip*"))
