"""What the study is made of."""

from collections.abc import Callable

from studies.base.study import Config, Study
from studies.sounds.examples import (
    COMPARISON,
    DESIGN,
    FOLDER,
    OF_CLIPS,
    OF_RECORDINGS,
    WITHOUT_RECORDINGS,
    examples,
    seeded,
)

READ = ("designs", "frequencies", "nearness", "distances")
"""Tables of an example that the page of all of them is made from."""
SOUND = Study(
    name="sound",
    package="studies.sounds",
    folder=FOLDER,
    title="An example of sound design",
    results="results:SoundResults",
    tables=(
        *("designs", "frequencies", "truth", "nearness", "distances", "loudness"),
        *("checks", "reach"),
        *("amplitudes", "optimisers", "evaluation", "provenance"),
    ),
    file="{example}/page.html",
)


def _made(listed: str) -> Callable[[Config], list[str]]:
    made = [*(f"tables/{name}.json" for name in READ), "page.html"]
    return lambda config: [f"{name}/{file}" for name in config["sound"][listed] for file in made]


SOUNDS = Study(
    name="sounds",
    folder=FOLDER,
    title="All examples of sound design",
    results="index:Examples",
    tables=("sounds", "distances"),
    tabulated="index",
    page="index:page",
    file="index.html",
    measured=_made(WITHOUT_RECORDINGS),
)
SOUNDS_OF_RECORDINGS = Study(
    name="sounds_of_recordings",
    package="studies.sounds",
    folder=FOLDER,
    title="Sound design from real recordings",
    results="index:OfRecordings",
    tables=("sounds", "distances"),
    tabulated="index",
    prefix=f"{OF_RECORDINGS}-",
    page="index:page",
    file=f"{OF_RECORDINGS}.html",
    measured=_made(OF_RECORDINGS),
)
SOUNDS_OF_CLIPS = Study(
    name="sounds_of_clips",
    package="studies.sounds",
    folder=FOLDER,
    title="Sound design with all defaults",
    results="index:OfClips",
    tables=("pairs", "seeds"),
    tabulated="pairs",
    prefix=f"{OF_CLIPS}-",
    page="index:page",
    file=f"{OF_CLIPS}.html",
    measured=lambda config: [
        *(f"{name}/page.html" for name in config["sound"][OF_CLIPS]),
        *(
            f"{name}/{DESIGN}"
            for name in dict.fromkeys([*config["sound"][OF_CLIPS], *seeded(config)])
        ),
    ],
)
COMPARED_SOUNDS = Study(
    name="compared_sounds",
    package="studies.sounds",
    folder=FOLDER,
    title="Optimisers of sound designs",
    results="comparison:ComparedSounds",
    tables=("comparison",),
    tabulated="comparison",
    page="comparison:page",
    file="comparison.html",
    measured=lambda config: [
        f"{name}/{COMPARISON}" for name, each in examples(config).items() if each.recorded
    ],
)
