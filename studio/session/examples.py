"""Examples that open with one click: built-in solids, and clips that are synthesised for them."""

from dataclasses import dataclass

from carillon.builtin_names import BUILTIN_PREFIX
from sound.clips.instruments import synthesised
from sound.clips.wav import PEAK, as_wav
from studio.session.document import Document, Target
from studio.session.workspace import Workspace

RATE_HERTZ = 44_100
Point = tuple[float, float, float]


@dataclass(frozen=True)
class ExampleClip:
    """A synthesised clip, the point [m] it is given to, and how many of its modes are taken."""

    target: str
    at: Point
    instrument: str
    pitch_hz: float
    seconds: float
    modes: int | None = None


@dataclass(frozen=True)
class ExampleProject:
    """A solid and its clips."""

    name: str
    says: str
    mesh: str
    resolution: int
    clips: tuple[ExampleClip, ...]

    def open(self, workspace: Workspace) -> Document:
        """The example as a document; its clips are written to the workspace."""
        targets = []
        for number, clip in enumerate(self.clips):
            sound = synthesised(clip.instrument, clip.pitch_hz, clip.seconds, RATE_HERTZ, number)
            samples = sound.modal_part() + sound.residual
            content = as_wav(samples * (PEAK / abs(samples).max()), RATE_HERTZ)
            file = workspace.put(f"{self.name}-{clip.target}.wav", content)
            targets.append(Target(clip.target, at=clip.at, clip=file, modes=clip.modes))
        settings = {
            "mesh": f"{BUILTIN_PREFIX}{self.mesh}",
            "resolution": self.resolution,
        }
        return Document(settings, tuple(targets))


EXAMPLES = (
    ExampleProject(
        "metal-bar",
        "a bar that comes to sound like a metal plate",
        "bar",
        32,
        (ExampleClip("corner", (0.12, 0.0225, 0.03), "metal", 420.0, 1.0, 6),),
    ),
    ExampleProject(
        "metal-bell",
        "a bell that comes nearer to a metal plate: 32 modes at once are more than it can have",
        "bell",
        24,
        (ExampleClip("rim", (0.068, 0.0, 0.007), "metal", 420.0, 1.5),),
    ),
    ExampleProject(
        "pan-of-two",
        "a frying pan of metal whose handle is of wood: nobody can have all of it, see how near",
        "frying-pan",
        32,
        (
            ExampleClip("plate", (0.0, 0.0, 0.01), "metal", 420.0, 1.5),
            ExampleClip("handle", (0.3, 0.0, 0.02), "wood", 520.0, 1.0),
        ),
    ),
)
