"""A scene: its objects, who hears and sees them, and how they are followed."""

from dataclasses import KW_ONLY
from typing import Annotated, Literal

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.parameters import REQUIRED, Check, Within, option, parameters
from carillon.parameters.quantities import File, between
from carillon.parameters.sentences import ParameterError, did_you_mean
from sound.scenes.object_entry import FILES, Coordinate, Material, ObjectEntry, Vector

GROUND_NAME = "ground"
"""What lists and scenes call the floor."""
LISTED = 10
"""Greatest number of objects that a message lists."""
RadiationMethod = bool | Literal["boundary-elements"]
"""Whether bodies move the air, as spheres of their surfaces if True, or as the solids they are."""


def _in_time(path: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if any(later[0] <= before[0] for before, later in zip(path, path[1:])):
        raise ValueError("expected times that ascend")
    return path


@parameters
class ListenerEntry:
    """Who hears a scene."""

    position: Vector | None = option(
        None, "where the middle of the head is [m]; where the camera is if null"
    )
    facing: Vector | None = option(
        None, "point that the nose is turned to [m]; what the camera looks at if null"
    )
    path: (
        Annotated[
            tuple[tuple[Coordinate, Coordinate, Coordinate, Coordinate], ...],
            Within(min_length=1, max_length=10_000),
            Check(_in_time),
        ]
        | None
    ) = option(
        None,
        "lines of time [s] and x, y, z [m] that the head moves along, in place of the position",
    )

    hrtf: File | None = option(
        None,
        "measured head in place of a spherical one: SOFA file (AES69, convention "
        "SimpleFreeFieldHRIR), relative to the scene",
        metavar="FILE.sofa",
    )

    def __post_init__(self) -> None:
        if self.path is not None and self.position is not None:
            raise ValueError("expected position or path, found both")


@parameters
class CameraEntry:
    """From where a scene is seen."""

    position: Vector | None = option(None, "where the camera is [m]; a place that sees all if null")
    target: Vector | None = option(None, "what it looks at [m]; the middle of all objects if null")
    degrees: Annotated[float, between(1.0, 170.0)] = option(
        36.0, "vertical field of view [degrees]"
    )


@parameters
class SoundEntry:
    """How a scene sounds."""

    rate: Annotated[int, between(8000, 192_000)] = option(44_100, "samples per second [Hz]")
    full_scale: Annotated[float, between(1e-12, 1e12)] | Literal["auto"] = option(
        "auto",
        "sound pressure of full scale [Pa]; auto lets the loudest sample just reach it, if that is "
        "not below the threshold of hearing (2e-5 Pa)",
    )
    radiation: RadiationMethod = option(
        True,
        "whether modes and the motion of the whole body are heard as they move the air, a solid "
        "as a sphere of its surface, or by boundary-elements as the solid that it is, which takes "
        "minutes once a solid; without, modes are as loud as they are struck, as by carillon "
        "render",
    )
    space: bool = option(
        True,
        "whether distance and direction are heard; without, all is one metre away, alike in both "
        "ears",
    )
    contact_damping: bool = option(True, "whether what a solid lies on damps it")
    noise: bool = option(True, "whether what clips of designs hold besides modes is heard")


@parameters
class EngineEntry:
    """How contacts are followed in time."""

    contact_seconds: Annotated[float, between(1e-4, 0.02)] = option(
        0.002,
        "how long a bounce takes for the engine [s]; what is heard takes as long as Hertz says",
    )
    steps: Annotated[int, between(8, 200)] = option(16, "steps in that time [1]")

    @property
    def step_seconds(self) -> float:
        """Duration of a step [s]."""
        return self.contact_seconds / self.steps


@parameters
class Scene:
    """Solids that fall, roll and strike each other, where they are heard and seen.

    Once it is loaded, its files hold in the working directory.
    """

    _: KW_ONLY
    title: Annotated[str, Within(min_length=1, max_length=200)] = option(
        "Scene", "what pages call the scene"
    )
    seconds: Annotated[float, between(0.01, 600.0)] = option(5.0, "how long it lasts [s]")
    gravity: Vector = option(
        (0.0, 0.0, -9.81),
        "acceleration of what falls, x, y, z, of which z points up [m/s^2]",
    )
    ground: Coordinate | None = option(0.0, "height of a floor without end [m]; null for none")
    ground_material: Material = option("concrete", "what the floor is made of, a material by name")
    objects: Annotated[tuple[ObjectEntry, ...], Within(min_length=1, max_length=1000)] = option(
        REQUIRED, "solids of the scene"
    )
    listener: ListenerEntry = option(ListenerEntry, "who hears it")
    camera: CameraEntry = option(CameraEntry, "from where it is seen")
    sound: SoundEntry = option(SoundEntry, "how it sounds")
    engine: EngineEntry = option(EngineEntry, "how contacts are followed in time")
    seed: Annotated[int, between(0, 2**32 - 1)] = option(0, "seed of the roughness of surfaces")

    def __post_init__(self) -> None:
        names = [each.name for each in self.objects]
        for number, name in enumerate(names):
            if name in names[:number]:
                raise ParameterError(
                    ("objects", number, "name"),
                    f"several objects are named {name!r}; give each a name of its own",
                )
        if self.listener.hrtf is not None and not self.sound.space:
            raise ParameterError(
                ("listener", "hrtf"), "a measured head hears directions; leave out space: false"
            )
        self._require_support()

    def _require_support(self) -> None:
        """Refuse objects that stand on what is not there, or on each other in a circle."""
        below = {each.name: each.stands_on for each in self.objects}
        for number, (name, support) in enumerate(below.items()):
            path = ("objects", number, "stands_on")
            if support == GROUND_NAME and self.ground is None:
                raise ParameterError(path, "there is no ground; give the ground a height")
            if support not in (None, GROUND_NAME, *below):
                others = [each for each in below if each != name]
                meant = did_you_mean(str(support), [GROUND_NAME, *others])
                listed = ", ".join([GROUND_NAME, *others[:LISTED]])
                rest = f" and {len(others) - LISTED} more" if len(others) > LISTED else ""
                raise ParameterError(
                    path, f"found {support!r}, expected one of {listed}{rest}{meant}"
                )
            chain = [name]
            while support in below:
                if support in chain:
                    raise ParameterError(
                        path, f"{' on '.join([*chain, support])}: nothing carries them"
                    )
                chain.append(support)
                support = below[support]

    @property
    def files(self) -> list[str]:
        """Files that it is made from."""
        named = [getattr(each, key) for each in self.objects for key in FILES]
        files = [name for name in named if name and not name.startswith(BUILTIN_PREFIX)]
        regions = [region for each in self.objects for region in each.regions]
        head = [self.listener.hrtf] if self.listener.hrtf else []
        return files + [name for region in regions for name in region.files] + head
