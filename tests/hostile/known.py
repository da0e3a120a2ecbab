"""Rows that programs do not refuse yet, or not in one sentence; mended ones are taken out."""

from __future__ import annotations

KNOWN = {
    "design goes on from one nan": "a design file's numbers",
    "design goes on from one claims": "the sentence does not name the file",
    "impulse 1e-300": "accepted",
    "render design-complex.h5": "a design file's numbers",
    "render design-nan.h5": "a design file's numbers",
    "render design-frequencies-nan.h5": "a design file's numbers",
    "render design-faces-below.h5": "a design file's numbers",
    "render like another solid": "accepted",
    "render onto the design": "a design called .wav is replaced",
    "export of design-nan.h5": "a design file's numbers",
    "export of design-faces-below.h5": "a design file's numbers",
    "configuration ''": "means the default one",
    "rates odd/pipe.json": "waits for the pipe",
    "rates ''": "means the packaged ones",
    "table that is a pipe": "passed over",
    "out that is one of both": "accepted",
    "digest modes-link.h5": "links are followed",
    "validate into a file": "two lines",
    "validate into a device": "two lines",
    "validate below a file": "two lines",
    "validate into /proc": "two lines",
    "validate into a closed folder": "two lines",
    "mesh with a command": "told by the job",
    "mesh with a command in backticks": "told by the job",
    "mesh with two commands": "told by the job",
    "mesh with an unknown object": "told by the job",
    "mesh with a blank": "told by the job",
    "mesh with nothing built in": "told by the job",
    "results in a folder of the system": "told by the job",
    "results in a device": "told by the job",
}
"""Names of rows, and what happens instead."""
