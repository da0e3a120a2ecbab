"""Tables of what was compared, what proves it, and where it comes from."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import carillon.fem.materials
from dataset_gen.objectives import OBJECTIVES
from solver.coarsening.forest import FOREST
from workflow.report import evidence_tables
from workflow.report.table import Column, Table
from workflow.study.cases import Case, Study
from workflow.study.identity import IDENTITY, identity

BASELINES = {
    "galerkin": "No fit: the moduli that give the Galerkin projection of the fine stiffness.",
    "average": "No fit: the mean of the block’s eight moduli at every point.",
}


def truths(study: Study) -> Table:
    """Size and proof of every ground truth."""
    return Table(
        "truths",
        "Ground truth of every case by SLEPc on the fine mesh: eigenvalues found below a shift μ, "
        "and counted there by the inertia of K − μM; wall seconds on one core.",
        [
            *IDENTITY,
            Column("unknowns", "Unknowns", "count"),
            Column("coarse_unknowns", "coarsened", "count"),
            Column("blocks", "Blocks", "count"),
            Column("distinct_blocks", "distinct", "count"),
            Column("modes", "Modes", "count"),
            Column("inertia", "Found / counted"),
            Column("residual_max", "Largest residual", "small"),
            Column("orthogonality", "|XᵀMX − I|", "small"),
            Column("seconds", "Time", "seconds", "s"),
        ],
        [_truth_row(study, case) for case in study.found],
    )


def _truth_row(study: Study, case: Case) -> dict[str, Any]:
    found = study.found[case]
    truth = found["truth"]
    counted = "inertia_count" in truth
    return {
        **identity(study, case),
        "unknowns": found["n_dofs"],
        "coarse_unknowns": found["coarse_n_dofs"],
        **{key: found[key] for key in ("blocks", "distinct_blocks", "modes")},
        "inertia": f"{truth['inertia_expected']} / {truth['inertia_count']}" if counted else None,
        **{key: truth[key] for key in ("residual_max", "orthogonality", "seconds")},
    }


def objectives(study: Study) -> Table:
    """What each objective is."""
    return Table(
        "objectives",
        "What is fitted, block by block; the last two coarsen without a fit.",
        [Column("coarsening", "Objective"), Column("description", "What it is")],
        [
            {"coarsening": name, "description": description(name, study.forest)}
            for name in study.coarsenings
        ],
    )


def description(coarsening: str, forest: Mapping[str, str] | None = None) -> str:
    """What a baseline or the forests are, or the first line of an objective's documentation."""
    if coarsening in BASELINES:
        return BASELINES[coarsening]
    if coarsening == FOREST:
        assert forest is not None
        return (
            f"No fit: regression forests that have learned {forest['forest_objective']}; "
            f"{forest['forest']}, SHA-256 {forest['forest_sha256']}…"
        )
    documentation = inspect.getdoc(inspect.getmodule(OBJECTIVES[coarsening])) or ""
    first = documentation.split("\n", 1)[0].removeprefix(f"Objective `{coarsening}`:")
    text = first.replace("`", "").strip()
    return text[:1].upper() + text[1:]


def materials(study: Study) -> Table:
    """What each material is."""
    return Table(
        "materials",
        "Young’s modulus from voxel to voxel; Poisson’s ratio and density are the same everywhere.",
        [Column("material", "Material"), Column("description", "What it is")],
        [{"material": name, "description": _material(name)} for name in study.materials],
    )


def _material(name: str) -> str:
    """First line of the documentation of a named material."""
    documentation = inspect.getdoc(getattr(carillon.fem.materials, name.replace("-", "_"))) or ""
    return documentation.split("\n", 1)[0]


def provenance(study: Study) -> Table:
    """Command, code and machine behind every case."""
    return evidence_tables.provenance_table(
        {f"cases/{case.path}": found["provenance"] for case, found in study.found.items()}
    )
