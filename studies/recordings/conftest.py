"""The folder of real recordings, which tests of them take."""

import os
from pathlib import Path

import pytest

from studies.recordings.packages import SOUNDS
from tests.documentation import CHECKOUT


@pytest.fixture(scope="session")
def recordings_folder() -> Path:
    """Folder of the packages with real recordings; skips the test where it is absent."""
    named = os.environ.get("CARILLON_RECORDINGS")
    folder = Path(named) if named else CHECKOUT / "results" / "recordings" / "packages"
    if not all((folder / package).is_dir() for package in SOUNDS):
        pytest.skip(
            f"no recordings in {folder}; `carillon recordings --out FOLDER` brings them, and "
            "CARILLON_RECORDINGS names another folder"
        )
    return folder
