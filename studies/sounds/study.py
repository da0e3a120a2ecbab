"""What the study is made of."""

from __future__ import annotations

from studies.base.study import Study

SOUND = Study(
    name="sound",
    package="studies.sounds",
    folder="sound",
    title="An example of sound design",
    results="results:SoundResults",
    page="page:page",
)
SOUNDS = Study(
    name="sounds",
    package="studies.sounds",
    folder="sound",
    title="All examples of sound design",
    results="index:Examples",
    page="index:page",
    tables="index.yaml",
)
COMPARED_SOUNDS = Study(
    name="compared_sounds",
    package="studies.sounds",
    folder="sound",
    title="Optimisers of sound designs",
    results="comparison:ComparedSounds",
    page="comparison:page",
    tables="comparison.yaml",
)
SOUNDS_OF_RECORDINGS = Study(
    name="sounds_of_recordings",
    package="studies.sounds",
    folder="sound",
    title="Sound design from real recordings",
    results="index:OfRecordings",
    page="index:page",
    tables="index.yaml",
)
