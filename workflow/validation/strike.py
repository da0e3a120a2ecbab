"""Sections of the page on a strike: how the solid moves, and how it sounds."""

from collections.abc import Iterable

import numpy as np

from solver.response.response import STRIKE_SECONDS
from studies.base import parts
from studies.base.media import embedded, inlined, wav_uri
from studies.base.page import Section, section
from studies.base.parts import grid, html, plot, prose, unbroken
from studies.base.table import Table
from workflow.composition import surface_of
from workflow.report.verdict import variant_name
from workflow.validation import plots
from workflow.validation.evidence import COARSENED, Evidence
from workflow.validation.pictures import struck_picture
from workflow.variants import TRUTH, VARIANTS

CHOSEN = """ The ground truth chose both: where its six lowest elastic modes give way most to a
    push, and what moves most far from there."""
RIGID_MOTION = "What is not held also flies off and turns. That rigid motion is left out."
HELD = "It is held, so there is no rigid motion."
STRIKES = """Spectrograms of three strikes, {} s apart, at the arrow, at the ring and at {}, by a
    force of half a sine of {:fraction} ms. Each is heard at the point that is struck: the sum of
    a<sub>k</sub> exp(−ξ<sub>k</sub>ω<sub>k</sub>t) sin(ω<sub>d</sub>t) over the modes from 20 Hz to
    20 kHz, with a<sub>k</sub> = (u<sub>k</sub><sup>T</sup>f)(u<sub>k</sub><sup>T</sup>n). Every
    strike is played so that the ground truth’s are equally loud; levels are below its loudest.
    Radiation into the air is not modelled."""


def lengths(values: Iterable[float]) -> str:
    """Lengths along the axes."""
    return " × ".join(unbroken(each, "fraction") for each in values)


def _place(evidence: Evidence, name: str) -> str:
    position = evidence.response.contacts[name].position / evidence.settings["unit"]
    return parts.place(position.tolist())


def motion(evidence: Evidence, table: Table) -> Section:
    """Where and how the solid is struck, and how it moves."""
    response, model = evidence.response, evidence.shown[TRUTH].model
    strike, observed = response.contacts["strike"], response.contacts["observed"]
    picture = struck_picture(model.mesh, strike, observed, evidence.skin(evidence.model, model))
    alt = f"{evidence.titles[evidence.model]}: where it is struck and watched"
    coarse = COARSENED in evidence.shown
    chosen = any(evidence.settings[name] is not None for name in ("strike", "observed"))
    where = f"""The arrow is where an impulse of 1 N·s strikes along the inward normal, at
        {_place(evidence, "strike")}; the ring is the point that is watched, at
        {_place(evidence, "observed")}, in the mesh’s own coordinates.{"" if chosen else CHOSEN}"""
    how = html(
        """{rigid} The elastic modes alone are superposed. Damping is Rayleigh’s,
        {mass_damping:fraction} s⁻¹ of the mass and {stiffness_damping:small} s of the
        stiffness.{}""",
        """ The coarsened solid is watched at the same point, interpolated in the cell that it lies
        in."""
        if coarse
        else "",
        rigid=RIGID_MOTION if model.rigid_modes else HELD,
        **response.attributes,
    )
    about = html(
        """Displacement of the ringed point over {:fraction} ms, along the direction in which it
        moves most, and length of its difference from the ground truth’s over the ground truth’s
        largest displacement. A frequency that is slightly off runs out of step after some swings,
        so {} difference grows although it moves alike.""",
        1e3 * float(response.seconds[-1]),
        "the coarsened solid’s" if coarse else "a",
    )
    return section(
        "Motion after a strike",
        parts.div(
            "beside",
            parts.figure(parts.image(embedded(picture), alt)),
            parts.element("div", parts.element("p", where), parts.element("p", how)),
        ),
        plot(inlined(plots.motion_figure(response), "motion"), about),
        grid(table),
        menu="Motion",
    )


def sound(evidence: Evidence) -> Section:
    """Sound and spectrogram of every method; a sentence if no mode of the truth is heard."""
    response = evidence.response
    if not response.responses[TRUTH].sound.any():
        surface = surface_of(evidence.config, evidence.model)
        sides = lengths(np.ptp(np.asarray(surface.bounds), axis=0))
        silent = f"""Nothing is to be heard: no elastic mode lies between 20 Hz and 20 kHz. Check
            the unit of the mesh; the solid measures {sides} m."""
        return section("Sound", prose(silent))
    loudest = max(float(np.abs(part.sound).max()) for part in response.responses.values())
    rate = int(response.attributes["sample_rate"])
    panels = []
    for variant, part in response.responses.items():
        away = html(", {:small} dB from the ground truth", part.distance_decibels)
        heard = html(
            "<span>{} modes heard{}</span>", part.audible, "" if variant == TRUTH else away
        )
        drawn = inlined(plots.sound_figure(response, variant), f"sound-{variant}")
        source = wav_uri(part.sound, rate, loudest)
        player = parts.audio(source, f"Sound by {VARIANTS[variant].label}")
        caption = parts.facts(variant_name(variant), heard)
        panels.append(parts.figure(caption, drawn, player, class_="plot"))
    contact = 1e3 * response.attributes["contact_seconds"]
    about = html(STRIKES, STRIKE_SECONDS, _place(evidence, "third"), contact)
    proof = parts.element("p", about, class_="proof")
    return section("Sound", parts.div("panels", *panels), proof)
