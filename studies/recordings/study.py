"""What the study is made of."""

from studies.base.study import Config, Study
from studies.recordings.recordings import EXTRACTED, FORMATS, START, recordings

RECORDING = Study(
    name="recording",
    package="studies.recordings",
    folder="recordings",
    title="Extraction on a real recording",
    results="results:RecordingResults",
    tables=("modes", "missed", "provenance"),
    file="{recording}/page.html",
)


def _pages(config: Config) -> list[str]:
    return [f"{name}/page.html" for name in recordings()]


RECORDINGS = Study(
    name="recordings",
    title="Extraction on real recordings",
    results="index:Recordings",
    tables=("clips", "groups", "formats"),
    tabulated="index",
    page="index:page",
    file="index.html",
    measured=lambda config: [START, FORMATS, *(f"{name}/{EXTRACTED}" for name in recordings())],
    beside=_pages,
)
