"""The file `response.h5`: how one solid moves and sounds when struck, by several spectra."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.files.datasets import put
from carillon.files.hdf5 import create_h5, open_h5
from carillon.parameters import option, parameters
from carillon.parameters.quantities import Point, between
from carillon.records import provenance
from solver.files.modes_file import read_elastic, require_same_solid
from solver.response.contact import Contact, choose_contacts
from solver.response.response import (
    SAMPLE_RATE_HERTZ,
    Contacts,
    Damping,
    at_contacts,
    contact_sounds,
    displacements,
    in_turn,
    is_audible,
    relative_difference,
    spectral_distance,
)
from solver.subspace.weyl import clusters

KIND = "response"
SCHEMA = 2
TRUTH = "truth"
POINTS = ("strike", "observed", "third")
SEEN = {"eigenvalues": "rad^2/s^2", "motion": "kg^-1/2", "push": "kg^-1/2"}
INSTANTS = 1500


@parameters
class StrikeOptions:
    """How a solid is struck and watched; for the points see `choose_contacts`."""

    strike: Point | None = option(
        None,
        "point of the surface that is struck [m] (default: chosen by the truth)",
        metavar=("X", "Y", "Z"),
    )
    observed: Point | None = option(
        None,
        "point of the surface whose motion is watched [m] (default: chosen by the truth)",
        metavar=("X", "Y", "Z"),
    )
    mass_damping: Annotated[float, between(0.0, 1e12)] = option(
        Damping.mass_per_second, "coefficient of the mass in Rayleigh damping [1/s]"
    )
    stiffness_damping: Annotated[float, between(0.0, 1e6)] = option(
        Damping.stiffness_seconds, "coefficient of the stiffness in Rayleigh damping [s]"
    )
    contact_seconds: Annotated[float, between(1e-9, 10.0)] = option(
        2e-4, "duration of the force in the sound [s]"
    )
    periods: Annotated[float, between(1e-6, 1e6)] = option(
        6.0, "time watched, in periods of the first elastic mode"
    )

    @property
    def damping(self) -> Damping:
        """Rayleigh damping."""
        return Damping(self.mass_damping, self.stiffness_damping)


@dataclass(frozen=True)
class Response:
    """What one spectrum makes of a strike."""

    displacement: Array
    """(t, 3) [m]: displacement of the observed point after an impulse of 1 N s at the struck
    one."""
    sound: Array
    """(s,) sound pressure at `SAMPLE_RATE_HERTZ`: strikes at all points in turn, each relative to
    the loudest that the truth has, see `solver.response.response.contact_sounds`."""
    audible: int
    """Number of modes that sound."""
    difference: float
    """Relative 2-norm of the displacement's difference from the truth's."""
    distance_decibels: float
    """Rms difference of the spectrograms; NaN where the truth is not heard."""


@dataclass(frozen=True)
class ResponseFile:
    """Contents of the file."""

    seconds: Array
    """(t,) instants of the displacements."""
    contacts: dict[str, Contact]
    """The points, by the names `POINTS`."""
    seen: Contacts
    """The truth's modes at these points, as far as motions are made of them: without the last
    cluster, which the end of the spectrum may cut."""
    responses: dict[str, Response]
    """By name of the spectrum, the first being the truth."""
    attributes: dict[str, Any] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    """Damping and so on; origin of the numbers."""


def respond(
    truth: str | Path, candidates: dict[str, str | Path], options: StrikeOptions
) -> ResponseFile:
    """Strike the solid of the modes file `truth`, and what the `candidates` by name take it for.

    Raises UserError if a file is unusable or holds no elastic mode, a point is away from the
    surface, or the motion leaves the range of numbers.
    """
    reference = read_elastic(truth)
    points = choose_contacts(reference, options.strike, options.observed)
    seen = {TRUTH: at_contacts(reference, points)}
    for name, path in candidates.items():
        candidate = read_elastic(path)
        require_same_solid([truth, path], [reference, candidate])
        seen[name] = at_contacts(candidate, points)
    period = 2.0 * np.pi / np.sqrt(seen[TRUTH].eigenvalues[0])
    seconds = np.linspace(0.0, options.periods * period, INSTANTS)
    whole = clusters(seen[TRUTH].eigenvalues)[-1].start or len(seen[TRUTH].eigenvalues)
    motions = {
        name: displacements(part.lowest(whole), options.damping, seconds)
        for name, part in seen.items()
    }
    sounds = _played(seen, options)
    heard = sounds[TRUTH].any()
    for name in seen:
        if not (np.isfinite(motions[name]).all() and np.isfinite(sounds[name]).all()):
            raise UserError(
                f"the response of {name!r} is not a finite number; choose a lower damping or a "
                "longer contact, or compute its modes again"
            )
    return ResponseFile(
        seconds,
        dict(zip(POINTS, points, strict=True)),
        seen[TRUTH].lowest(whole),
        {
            name: Response(
                motions[name],
                sounds[name],
                int(is_audible(part.eigenvalues).sum()),
                relative_difference(motions[name], motions[TRUTH]),
                spectral_distance(sounds[name], sounds[TRUTH]) if heard else float("nan"),
            )
            for name, part in seen.items()
        },
        {
            "mass_damping": options.damping.mass_per_second,
            "stiffness_damping": options.damping.stiffness_seconds,
            "contact_seconds": options.contact_seconds,
            "periods": options.periods,
            "sample_rate": SAMPLE_RATE_HERTZ,
        },
    )


def write_response(path: str | Path, response: ResponseFile, parameters: dict[str, Any]) -> None:
    """Write the file atomically; `parameters` are those of the command, for the provenance."""
    with create_h5(path, KIND, SCHEMA, sealed=True) as file:
        file.attrs.update(response.attributes)
        put(file, "seconds", response.seconds, "s")
        for name, contact in response.contacts.items():
            put(file, f"points/{name}/position", contact.position, "m")
            put(file, f"points/{name}/inward", contact.inward, "1")
        for name, units in SEEN.items():
            put(file, f"seen/{name}", getattr(response.seen, name), units)
        for name, part in response.responses.items():
            put(file, f"spectra/{name}/displacement", part.displacement, "m")
            put(file, f"spectra/{name}/sound", part.sound, "m/s")
            file[f"spectra/{name}"].attrs.update(
                audible=part.audible,
                difference=part.difference,
                distance_decibels=part.distance_decibels,
            )
        file.attrs["order"] = list(response.responses)
        provenance.write(file, parameters)


def read_response(path: str | Path) -> ResponseFile:
    """Read the file.

    Raises UserError if it is missing, damaged or of another kind.
    """
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        attributes = dict(file.attrs)
        contacts = {
            name: Contact(file[f"points/{name}/position"][()], file[f"points/{name}/inward"][()])
            for name in POINTS
        }
        seen = Contacts(*(file[f"seen/{name}"][()] for name in SEEN))
        responses = {}
        for name in attributes.pop("order"):
            group = file[f"spectra/{name}"]
            responses[str(name)] = Response(
                group["displacement"][()],
                group["sound"][()],
                int(group.attrs["audible"]),
                float(group.attrs["difference"]),
                float(group.attrs["distance_decibels"]),
            )
        return ResponseFile(
            file["seconds"][()], contacts, seen, responses, attributes, provenance.read(file)
        )


def _played(seen: dict[str, Contacts], options: StrikeOptions) -> dict[str, Array]:
    sounds = {
        name: contact_sounds(part, options.damping, options.contact_seconds)
        for name, part in seen.items()
    }
    loudest = np.abs(sounds[TRUTH]).max(axis=1)
    return {name: in_turn(sound, loudest) for name, sound in sounds.items()}
