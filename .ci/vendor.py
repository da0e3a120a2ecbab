"""Brings the libraries of the studio's page, as studio/page/vendor/vendor.json lists them.

    python .ci/vendor.py                  the versions listed, checked against their hashes
    python .ci/vendor.py three@0.188.0    another version, whose hashes are listed from then on

npm loads the packages; nothing of them is run.
"""

from __future__ import annotations

import base64
import hashlib
import json
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

VENDOR = Path(__file__).resolve().parent.parent / "studio" / "page" / "vendor"
LIST = VENDOR / "vendor.json"


def npm(*words: str, folder: Path) -> Any:
    """What npm answers, as JSON."""
    done = subprocess.run(["npm", *words, "--json"], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"npm {' '.join(words)} failed: {done.stderr.strip()}")
    return json.loads(done.stdout)


def load(package: str, version: str, folder: Path) -> tuple[bytes, str]:
    """A package as it is published, and the integrity that npm lists for that."""
    name = f"{package}@{version}"
    integrity = npm("view", name, "dist.integrity", folder=folder)
    (packed,) = npm("pack", "--ignore-scripts", name, folder=folder)
    return (folder / packed["filename"]).read_bytes(), integrity


def integrity_of(content: bytes) -> str:
    """SHA-512 as npm writes it."""
    return "sha512-" + base64.b64encode(hashlib.sha512(content).digest()).decode()


def bring(entry: dict[str, Any], listed: bool) -> None:
    """Write the files of one package; `listed` demands the hashes that are listed, else lists them.

    Exits with a sentence where a hash is not what it should be.
    """
    name = f"{entry['package']}@{entry['version']}"
    with tempfile.TemporaryDirectory() as scratch:
        content, integrity = load(entry["package"], entry["version"], Path(scratch))
        expected = entry["integrity"] if listed else integrity
        if integrity_of(content) != expected:
            sys.exit(f"{name}: its SHA-512 is {integrity_of(content)}, expected {expected}")
        entry["integrity"] = expected
        packed = next(Path(scratch).glob("*.tgz"))
        with tarfile.open(packed) as archive:
            for file in entry["files"]:
                stream = archive.extractfile(f"package/{file['from']}")
                if stream is None:
                    sys.exit(f"{name}: {file['from']} is no file")
                text = stream.read()
                found = hashlib.sha256(text).hexdigest()
                if listed and found != file["sha256"]:
                    sys.exit(f"{name}: SHA-256 of {file['from']} is {found}, not as listed")
                file["sha256"] = found
                (VENDOR / file["file"]).parent.mkdir(parents=True, exist_ok=True)
                (VENDOR / file["file"]).write_bytes(text)
    print(f"{name}: {len(entry['files'])} files")


def main() -> None:
    """Bring what is listed, or the one package that is named."""
    listed = json.loads(LIST.read_text())
    if len(sys.argv) == 1:
        for entry in listed:
            bring(entry, listed=True)
        return
    for word in sys.argv[1:]:
        package, _, version = word.rpartition("@")
        entry = next((each for each in listed if each["package"] == package), None)
        if entry is None or not version:
            sys.exit(f"{word}: expected PACKAGE@VERSION of {[e['package'] for e in listed]}")
        entry["version"] = version
        bring(entry, listed=False)
    LIST.write_text(json.dumps(listed, indent=2) + "\n")


if __name__ == "__main__":
    main()
