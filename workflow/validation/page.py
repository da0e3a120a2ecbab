"""The page that says how far the spectra of one model can be trusted, and why."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import load_surface
from carillon.records import provenance
from solver.response.response import STRIKE_SECONDS
from studies.base.media import embedded, inlined, wav_uri
from studies.base.page import listed_modes, rendered
from studies.base.table import Table
from workflow import settings
from workflow.report.page import mode_pictures
from workflow.validation import plots
from workflow.validation.criteria import verdict
from workflow.validation.distance import distance_in_words
from workflow.validation.evidence import COARSENED, Evidence
from workflow.validation.pictures import solid_pictures, struck_picture
from workflow.variants import TRUTH, VARIANTS

_DIGITS = 16


def page(evidence: Evidence, tables: dict[str, Table]) -> str:
    """Build the page of a model from its tables and files."""
    return rendered(
        "workflow/validation/page.html.j2",
        title=evidence.titles[evidence.model],
        variants=VARIANTS,
        truth=TRUTH,
        config=evidence.config,
        model=evidence.settings,
        verdict=verdict(evidence),
        fine_taken=evidence.fine_taken(evidence.model),
        distance=distance_in_words(evidence),
        tables=tables,
        listed=listed_modes(tables["errors"].rows),
        solid=_solid(evidence),
        modes=mode_pictures(evidence, evidence.model),
        strike=_strike(evidence),
        sounds=_sounds(evidence),
        strike_seconds=STRIKE_SECONDS,
        errors=inlined(plots.errors_figure(evidence, tables["errors"]), "errors"),
        shapes=inlined(plots.shapes_figure(evidence), "shapes"),
        counted=evidence.shown[TRUTH].attributes,
        files=_digests(evidence),
        configuration=_configuration(evidence),
        page_record=provenance.record({"config": evidence.config}),
    )


def _solid(evidence: Evidence) -> dict[str, Any]:
    """Pictures and sizes of the solid."""
    mesh_name = settings.mesh_of(evidence.config, evidence.model)
    surface = load_surface(mesh_name, evidence.settings["unit"])
    file = evidence.shown[TRUTH]
    model, mesh = file.model, file.mesh
    cells = model.cells if isinstance(model, FiniteCellModel) else None
    young = model.young if cells else model.young[:, 0]
    titles = ("surface", "voxels", "material")
    share = cells.voxel_shares() if cells else None
    skin = evidence.skin(evidence.model, model)
    pictures = solid_pictures(surface, mesh, young, share, skin)
    coarse = evidence.shown.get(COARSENED)
    return {
        "mesh": mesh_name,
        "triangles": len(surface.faces),
        "closed": bool(surface.is_watertight),
        "surface_volume": float(abs(surface.volume)),
        "voxels": mesh.n_cells,
        "voxel_volume": cells.volume if cells else mesh.volume,
        "finite_cells": len(cells) if cells else None,
        "edge": mesh.edge,
        "sides": np.ptp(np.asarray(surface.bounds), axis=0).tolist(),
        "voxel_sides": None if cells else np.ptp(mesh.nodes, axis=0).tolist(),
        "mass": model.mass,
        "moduli": (float(young.min()), float(np.median(young)), float(young.max())),
        "coarse_cells": None if coarse is None else coarse.mesh.n_cells,
        "pictures": [
            embedded(picture, title=title) for title, picture in zip(titles, pictures, strict=True)
        ],
        "histogram": inlined(plots.moduli_figure(young), "moduli"),
    }


def _strike(evidence: Evidence) -> dict[str, Any]:
    """Where and how the solid is struck."""
    response = evidence.response
    strike, observed = response.contacts["strike"], response.contacts["observed"]
    model = evidence.shown[TRUTH].model
    skin = evidence.skin(evidence.model, model)
    picture = struck_picture(model.mesh, strike, observed, skin)
    unit = evidence.settings["unit"]
    return {
        "picture": embedded(picture),
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
        for variant in response.responses
    ]


def _digests(evidence: Evidence) -> list[tuple[str, str]]:
    """Names and first digits of the SHA-256 of the files that everything is made from."""
    given = settings.model_files(evidence.config, evidence.model)
    made = [str(evidence.modes_path(evidence.model, variant)) for variant in evidence.shown]
    digests = []
    for name in given + made:
        with open(name, "rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()[:_DIGITS]
        digests.append((Path(name).name, digest))
    return digests


def _configuration(evidence: Evidence) -> str:
    """The part of the configuration that tells on this solid."""
    config = evidence.config
    parts = {key: config[key] for key in ("poisson", "solver", "validation")}
    forests = {"model": config["forests"]["model"]}
    return yaml.safe_dump(
        {"models": {evidence.model: evidence.settings}, "forests": forests, **parts},
        sort_keys=False,
    )
