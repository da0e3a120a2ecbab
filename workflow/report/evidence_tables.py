"""Tables of what proves the numbers, and of where they come from."""

from __future__ import annotations

import json
from typing import Any

from solver.files.modes_file import ModesFile
from workflow.report.results import Results
from workflow.report.table import Column, Table
from workflow.variants import VARIANTS


def evidence(results: Results) -> Table:
    """Residual, orthogonality, inertia count of every run."""
    return Table(
        "evidence",
        "What every run proves about itself, from products with its own assembled matrices. The "
        "inertia of K − μM counts the eigenvalues below μ independently of the eigensolver: "
        "found equals counted when none is missed. The error estimate is the solver's own, from "
        "residuals.",
        [
            Column("model", "Solid"),
            Column("variant", "Method"),
            Column("residual_max", "Largest residual", "small"),
            Column("orthogonality", "|XᵀMX − I|", "small"),
            Column("rigid_modes", "Rigid modes", "count"),
            Column("inertia", "Found / counted"),
            Column("corrections", "Corrections", "count"),
            Column("estimate", "Error estimate", "small"),
            Column("subdomains", "Subdomains", "count"),
            Column("ranks", "Ranks", "count"),
            Column("peak_memory_bytes", "Peak memory", "bytes", "B"),
        ],
        [
            _evidence_row(model, variant, spectrum)
            for model, spectra in results.spectra.items()
            for variant, spectrum in spectra.items()
        ],
        ["model", "variant"],
    )


def _evidence_row(model: str, variant: str, spectrum: ModesFile) -> dict[str, Any]:
    found = spectrum.attributes
    counted = found.get("inertia_count", -1)
    return {
        "model": model,
        "variant": VARIANTS[variant].label,
        "residual_max": float(spectrum.residuals.max()),
        "orthogonality": found["orthogonality"],
        "rigid_modes": found["rigid_modes"],
        "inertia": f"{found['inertia_expected']} / {counted}" if counted >= 0 else None,
        "corrections": found.get("corrections", 0 if found["method"] == "hcms" else None),
        "estimate": found.get("eigenvalue_error_estimate"),
        "subdomains": found["subdomains"],
        "ranks": found["ranks"],
        "peak_memory_bytes": found["peak_memory_bytes"],
    }


def provenance(results: Results) -> Table:
    """Command, code and machine behind every result file."""
    origins = {f"dataset/{name}.h5": shard["provenance"] for name, shard in results.shards.items()}
    forests = results.config["forests"]["model"] or "forests/forests.h5"
    origins[forests] = results.forests["provenance"]
    origins["forests/table.json"] = results.blocks_record
    for model, spectra in results.spectra.items():
        for variant, spectrum in spectra.items():
            origins[f"models/{model}/{variant}.h5"] = spectrum.provenance
        if model in results.convergence:
            history = results.convergence[model]
            origins[f"models/{model}/convergence.json"] = history["provenance"]
        if model in results.methods:
            origins[f"models/{model}/methods.json"] = results.methods[model]["provenance"]
        if model in results.scaling:
            origins[f"models/{model}/scaling.json"] = results.scaling[model]["provenance"]
    return provenance_table(origins)


def provenance_table(origins: dict[str, dict[str, Any]]) -> Table:
    """Table of provenance records by result file."""
    return Table(
        "provenance",
        "Origin of every result file: the command, the commit of the code, seed and hash of all "
        "parameters, and the machine.",
        [
            Column("file", "File"),
            Column("command", "Command"),
            Column("commit", "Commit"),
            Column("seed", "Seed"),
            Column("config_hash", "Parameters' hash"),
            Column("blas", "BLAS"),
            Column("processor", "Processor"),
            Column("cores", "Cores", "count"),
            Column("versions", "Versions"),
        ],
        [_origin(file, origin) for file, origin in origins.items()],
    )


def _origin(file: str, origin: dict[str, Any]) -> dict[str, Any]:
    parameters = _unpacked(origin.get("parameters", "{}"))
    versions = _unpacked(origin.get("versions", "{}"))
    return {
        "file": file,
        **{key: origin.get(key) for key in ("command", "commit", "config_hash", "blas")},
        **{key: origin.get(key) for key in ("processor", "cores")},
        "seed": parameters.get("seed"),
        "versions": ", ".join(f"{name} {version}" for name, version in versions.items()),
    }


def _unpacked(text: Any) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(text) if isinstance(text, str) else text
    return loaded
