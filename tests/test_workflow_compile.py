"""Kernels are compiled once, whatever asks for them."""

import pytest

from workflow.__main__ import main
from workflow.commands import compile as command


@pytest.fixture
def commands(tmp_path, monkeypatch) -> list[list[str]]:
    """The commands that are run, instead of running them."""
    seen: list[list[str]] = []

    class Done:
        returncode = 0

    def run(words, **options):
        assert options["env"]["OMP_NUM_THREADS"] == "1"
        seen.append(words[2:])
        return Done()

    monkeypatch.setattr(command, "DONE", tmp_path / "done")
    monkeypatch.setattr(command.subprocess, "run", run)
    return seen


def test_a_group_is_compiled_once_and_again_when_a_source_changes(commands, monkeypatch):
    assert main(["compile", "spectra"]) == 0
    assert [" ".join(words) for words in commands] == list(command.GROUPS["spectra"])
    assert main(["compile", "spectra"]) == 0 and len(commands) == len(command.GROUPS["spectra"])
    assert main(["compile"]) == 0
    assert len(commands) == sum(map(len, command.GROUPS.values()))
    monkeypatch.setattr(command, "sources", lambda: "others")
    assert main(["compile", "spectra"]) == 0
    assert len(commands) == sum(map(len, command.GROUPS.values())) + len(command.GROUPS["spectra"])


def test_a_group_is_compiled_once_for_each_kind_of_processor(commands, monkeypatch):
    for compiles in (len(command.GROUPS["spectra"]), 0):
        for name, features in (("generic", ""), ("znver4", "+avx2"), ("znver4", "+avx512f")):
            commands.clear()
            monkeypatch.setenv("NUMBA_CPU_NAME", name)
            monkeypatch.setenv("NUMBA_CPU_FEATURES", features)
            assert main(["compile", "spectra"]) == 0
            assert len(commands) == compiles


def test_unknown_groups_are_refused(commands, capsys):
    assert main(["compile", "bells"]) == 2
    assert "no group 'bells' of kernels, expected training, spectra" in capsys.readouterr().err
    assert not commands


def test_a_command_that_fails_is_told_and_its_group_tried_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(command, "DONE", tmp_path / "done")
    monkeypatch.setitem(command.GROUPS, "spectra", ("solver modes builtin:none --out a.h5",))
    for _ in range(2):
        assert main(["compile", "spectra"]) == 2
        told = capsys.readouterr().err
        assert "kernels of spectra are not compiled: solver modes builtin:none" in told
