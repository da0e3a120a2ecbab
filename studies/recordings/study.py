"""What the study is made of."""

from __future__ import annotations

from studies.base.study import Study

RECORDING = Study(
    name="recording",
    package="studies.recordings",
    folder="recordings",
    title="Extraction on a real recording",
    results="results:RecordingResults",
    page="page:page",
)
RECORDINGS = Study(
    name="recordings",
    package="studies.recordings",
    folder="recordings",
    title="Extraction on real recordings",
    results="index:Recordings",
    page="index:page",
    tables="index.yaml",
)
