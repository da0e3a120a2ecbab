"""The page that says how far the spectra of one model can be trusted, and why."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from carillon import provenance
from carillon.fem.geometry import load_surface
from solver.response.response import STRIKE_SECONDS
from workflow import settings
from workflow.report.audio import wav_uri
from workflow.report.mode_pictures import CLUSTER_WIDTH
from workflow.report.page import page_template, picture_uri
from workflow.report.pictures import png_uri
from workflow.report.style import inlined
from workflow.report.table import Table
from workflow.validate import plots, tables
from workflow.validate.criteria import judge
from workflow.validate.evidence import Evidence
from workflow.validate.pictures import solid_pictures, struck_picture
from workflow.validate.verdict import verdict
from workflow.variants import SHOWN, TRUTH, VARIANTS

FIRST_MODES = 12
"""Elastic modes listed from the first on; beyond them `HIGHER_MODES`."""
HIGHER_MODES = (24, 32, 48, 64, 96, 128, 192, 256)
_DIGITS = 16


def build(evidence: Evidence) -> tuple[str, dict[str, Table]]:
    """The page of a model as HTML, and its tables by what they are about."""
    judged = judge(evidence)
    found = {
        "criteria": tables.criteria(evidence, judged),
        "errors": tables.errors(evidence),
        "shapes": tables.shapes(evidence),
        "audits": tables.audits(evidence),
        "responses": tables.responses(evidence),
        "provenance": tables.provenance(evidence),
    }
    page = page_template("validate/page.html.j2").render(
        title=evidence.results.title(evidence.model),
        variants=VARIANTS,
        truth=TRUTH,
        config=evidence.results.config,
        model=evidence.settings,
        verdict=verdict(judged),
        tables=found,
        listed=[row for row in found["errors"].rows if _is_listed(row["mode"])],
        solid=_solid(evidence),
        modes=_mode_pictures(evidence),
        cluster_width=CLUSTER_WIDTH,
        strike=_strike(evidence),
        sounds=_sounds(evidence),
        strike_seconds=STRIKE_SECONDS,
        errors=inlined(plots.errors_figure(found["errors"], evidence.tolerances), "errors"),
        shapes=inlined(plots.shapes_figure(evidence), "shapes"),
        counted=_counted_by_run(evidence),
        files=_digests(evidence),
        configuration=_configuration(evidence),
        page_record=provenance.record({"config": evidence.results.config}),
    )
    return page, found


def _is_listed(mode: int) -> bool:
    return mode < 7 + FIRST_MODES or mode in HIGHER_MODES


def _solid(evidence: Evidence) -> dict[str, Any]:
    """Pictures and sizes of the solid."""
    mesh_name = settings.mesh_of(evidence.results.config, evidence.model)
    surface = load_surface(mesh_name, evidence.settings["unit"])
    file = evidence.spectra[TRUTH]
    mesh, young = file.mesh, file.model.young[:, 0]
    titles = ("surface", "voxels", "material")
    pictures = solid_pictures(surface, mesh, young)
    return {
        "mesh": mesh_name,
        "triangles": len(surface.faces),
        "closed": bool(surface.is_watertight),
        "surface_volume": float(abs(surface.volume)),
        "voxels": mesh.n_cells,
        "voxel_volume": mesh.volume,
        "edge": mesh.edge,
        "sides": np.ptp(np.asarray(surface.bounds), axis=0).tolist(),
        "mass": file.model.mass,
        "moduli": (float(young.min()), float(np.median(young)), float(young.max())),
        "coarse_cells": evidence.spectra["ddfem_hcms_ec"].mesh.n_cells,
        "pictures": [
            {
                "title": title,
                "source": png_uri(picture),
                "height": picture.shape[0],
                "width": picture.shape[1],
            }
            for title, picture in zip(titles, pictures, strict=True)
        ],
        "histogram": inlined(plots.moduli_figure(young), "moduli"),
    }


def _mode_pictures(evidence: Evidence) -> list[dict[str, Any]]:
    return [
        {
            "variant": variant,
            "source": picture_uri(evidence.results.figure(f"{evidence.model}-mode-{variant}.png")),
            **evidence.mode_pictures[variant],
        }
        for variant in SHOWN
    ]


def _strike(evidence: Evidence) -> dict[str, Any]:
    """Where and how the solid is struck."""
    response = evidence.response
    strike, observed = response.contacts["strike"], response.contacts["observed"]
    picture = struck_picture(evidence.spectra[TRUTH].mesh, strike, observed)
    unit = evidence.settings["unit"]
    return {
        "picture": png_uri(picture),
        "height": picture.shape[0],
        "width": picture.shape[1],
        "points": {
            name: (contact.position / unit).tolist() for name, contact in response.contacts.items()
        },
        "chosen": {name: evidence.settings[name] is not None for name in ("strike", "observed")},
        "milliseconds": 1e3 * float(response.seconds[-1]),
        "motion": inlined(plots.motion_figure(response), "motion"),
        **response.attributes,
    }


def _sounds(evidence: Evidence) -> list[dict[str, Any]]:
    """Sound and spectrogram of every method; nothing if no mode of the truth is heard."""
    response = evidence.response
    if not response.responses[TRUTH].sound.any():
        return []
    loudest = max(float(np.abs(part.sound).max()) for part in response.responses.values())
    rate = int(response.attributes["sample_rate"])
    return [
        {
            "variant": variant,
            "plot": inlined(plots.sound_figure(response, variant), f"sound-{variant}"),
            "source": wav_uri(response.responses[variant].sound, rate, loudest),
            "audible": response.responses[variant].audible,
            "distance": response.responses[variant].distance_decibels,
        }
        for variant in SHOWN
    ]


def _counted_by_run(evidence: Evidence) -> dict[str, Any] | None:
    """What the run of the ground truth counted itself; None if it could not."""
    told = evidence.spectra[TRUTH].attributes
    return told if "inertia_count" in told else None


def _digests(evidence: Evidence) -> list[tuple[str, str]]:
    """Names and first digits of the SHA-256 of the files that everything is made from."""
    given = settings.model_files(evidence.results.config, evidence.model)
    made = [str(evidence.results.modes_path(evidence.model, variant)) for variant in SHOWN]
    found = []
    for name in given + made:
        with open(name, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()[:_DIGITS]
        found.append((Path(name).name, digest))
    return found


def _configuration(evidence: Evidence) -> str:
    """The part of the configuration that tells on this solid."""
    config = evidence.results.config
    parts = {key: config[key] for key in ("poisson", "solver", "validation")}
    forests = {"model": config["forests"]["model"]}
    return yaml.safe_dump(
        {"models": {evidence.model: evidence.settings}, "forests": forests, **parts},
        sort_keys=False,
    )
