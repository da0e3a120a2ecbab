"""The paper's figures in full: what is planned, and a miniature end to end."""

from types import SimpleNamespace

import pytest

from studies.base.table import read_table
from studies.benchmark import table as timed
from studies.figures.study import FIGURES
from studies.scaling.model import MISFIT_LIMIT
from tests.pages import finished_page
from tests.workflow_runs import LAPTOP, finished
from workflow import settings, solids
from workflow.report.convergence_tables import convergence_sentences
from workflow.report.methods_tables import METHODS

convergence, methods, ratios = map(FIGURES.entries.get, ("convergence", "methods", "ratios"))
CONFIG = settings.complete([LAPTOP])


def test_figures_are_no_part_of_the_default_run(plan):
    jobs = plan("figures")
    # Bunny and teapot have no mesh here.
    assert jobs["time_methods_in_full"] == 4
    assert jobs["follow_convergence_in_full"] == jobs["measure_scaling"] == 1
    assert "find_modes" not in jobs and "time_methods" not in jobs
    default = plan()
    assert default["time_methods"] == 4
    assert not {"time_methods_in_full", "measure_scaling"} & set(default)


def test_meshes_that_exist_take_part_and_others_are_named(tmp_path):
    (tmp_path / "teapot.obj").touch()
    config = {**CONFIG, "mesh_folder": str(tmp_path)}
    present = solids.named(config, "figures.models")
    assert "teapot" in present and "bunny" not in present
    assert solids.named(config, "figures.convergence") == ["frying-pan"]
    sentence = solids.without(config, "figures")
    assert "Without bunny:" in sentence and "stanford-bunny.obj" in sentence


def row(**seconds) -> dict:
    """Output of `solver benchmark`, as far as tables need it."""
    return {
        "modes": 30,
        "dof_fine": 900,
        "dof_coarse": 300,
        "seconds": {"precompute": 0.1, "slepc": 4.0, "hcms": None, **seconds},
        "spread": {name: {"min": 0.5, "max": 5.0} for name in ("slepc", *seconds)},
        "runs": {"slepc": 5, "hcms_ec": 5, "arpack": 1},
        "failed": {"hcms": "too few modes"},
        "eigenvalue_error": {"hcms_ec": {"max": 1e-7}},
        "frequency_error": {"average": {"rms_7_60": 0.3}},
        "speedup": {"hcms_ec": {"slepc": 2.0}},
        "speedup_with_precompute": {"hcms_ec": {"slepc": 1.5}},
        "slepc_configuration": {"package": "cholmod", "subspace": 1.5},
        "slepc_configurations_tried": [{}] * 6,
        "provenance": {},
    }


def results(**methods: dict) -> SimpleNamespace:
    """Results of a study with such a bar."""
    titles = dict.fromkeys(methods, "A bar")
    return SimpleNamespace(methods=methods, convergence={}, titles=titles, config={})


def test_the_table_of_methods_has_what_was_timed_and_says_how():
    table = methods(results(bar=row(hcms_ec=2.0)))
    keys = [column.key for column in table.columns]
    assert "hcms_ec" in keys and "arpack" not in keys and "hcms_ec_min" in keys
    assert "CHOLMOD, 1.5 Lanczos vectors a mode, the fastest of 6 tried" in table.caption
    assert "5 rounds (ARPACK 1)" in table.caption
    assert "bar, HCMS: too few modes." in table.caption
    assert table.rows[0]["hcms_ec_max"] == 5.0 and table.rows[0].get("ddfem_error") is None


def test_every_method_of_a_row_has_a_name_for_people():
    assert list(METHODS) == list(timed.METHODS)


def test_ratios_name_their_base():
    (ratio,) = ratios(results(bar=row(hcms_ec=2.0))).rows
    assert (ratio["method"], ratio["base"], ratio["ratio"]) == ("HCMS + EC", "SLEPc", 2.0)
    assert ratio["with_precompute"] == 1.5
    assert (ratio["ratio_min"], ratio["ratio_max"]) == (0.5 / 5.0, 5.0 / 0.5)
    # What is needed beforehand takes 2/3 s, run by run.
    assert ratio["with_precompute_max"] == pytest.approx(5.0 / (0.5 + 4.0 / 1.5 - 2.0))
    once = row(hcms_ec=2.0) | {"runs": {"slepc": 1, "hcms_ec": 5}}
    (ratio,) = ratios(results(bar=once)).rows
    assert ratio["ratio"] == 2.0 and "ratio_min" not in ratio


def test_tables_of_nothing_have_no_rows():
    assert methods(results()).rows == ratios(results()).rows == []
    assert convergence_sentences(convergence(results())) == []


@pytest.fixture(scope="module")
def miniature(tmp_path_factory):
    """Folder of the results of the miniature figures."""
    return finished(tmp_path_factory.mktemp("figures"), "figures") / "results-tiny" / FIGURES.folder


@pytest.mark.nightly
@pytest.mark.mpi
def test_the_page_of_miniature_figures_holds_its_tables_and_plots(miniature):
    page = finished_page(FIGURES, miniature)
    assert {"plot-bar-convergence", "plot-bar-scaling"} <= set(page.ids)
    assert "takes for granted" in page.source


@pytest.mark.nightly
@pytest.mark.mpi
def test_miniature_figures_find_what_the_paper_found(miniature):
    rows = read_table(miniature / "tables" / "convergence.json").rows
    last = {
        row["start"]: row["median"]
        for row in rows
        if row["corrections"] == 3 and "paper" in row["acceleration"]
    }
    assert last["HCMS, free interfaces"] < last["random vectors"]
    scaling = read_table(miniature / "tables" / "scaling.json").rows
    strong = {row["ranks"]: row for row in scaling if row["kind"] == "strong"}
    assert strong[1]["note"] == "measured" and strong[1]["measured"] > 0.0
    beyond = [row for row in strong.values() if row["note"] == "model alone"]
    misfits = [abs(row["misfit"]) for row in strong.values() if row["misfit"] is not None]
    assert bool(beyond) == (max(misfits) <= MISFIT_LIMIT)
