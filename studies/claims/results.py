"""Tables that claims are measured by: those of the run, of the full figures, of the reference."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from carillon.files.yaml_input import read_own_yaml
from forests import default as default_forests
from studies.base.conditions import Record
from studies.base.results import Results
from studies.base.table import Table, read_csv_table, read_table
from studies.claims.study import FULL, SCENE_PICTURE, SCENE_TABLE
from workflow import settings

HERE = Path(__file__).parent
REFERENCE = "results/reference/znver4"
"""Tables of a complete run that are kept in a checkout; an installed package has none."""
MEASURED = HERE / "measured.json"
"""Rows of `carillon benchmark` that take too long for a run, each with its command."""


@dataclass(frozen=True)
class Claims(Results):
    """The folder of the claims, below that of a run."""

    @cached_property
    def paper(self) -> dict[str, Any]:
        """Numbers that the paper prints."""
        return read_own_yaml(HERE / "paper.yaml")

    @property
    def run(self) -> Path:
        """Folder of the run."""
        return self.folder.parent

    @cached_property
    def read(self) -> dict[str, Table]:
        """Tables that were read, by path."""
        return {}

    def of_run(self, name: str) -> Table:
        """A table of the run."""
        return self._table(self.run / "tables" / f"{name}.json")

    def of_model(self, name: str) -> dict[str, Table]:
        """A table of every model's validation, by model."""
        folder = self.run / "validation" / "tables"
        return {
            model: self._table(folder / f"{model}-{name}.json") for model in self.config["models"]
        }

    def in_full(self, name: str) -> Table | None:
        """A table of the full figures: this run's, else the reference's; None without either."""
        own = self.run / FULL / "tables" / f"{name}.json"
        kept = settings.FOLDER.parent / REFERENCE / FULL / "tables" / f"{name}.csv"
        return next((self._table(path) for path in (own, kept) if path.is_file()), None)

    @cached_property
    def scene(self) -> Table | None:
        """Spectra of a scene by the truth's and by coarse modes, if the run has them."""
        path = self.run / SCENE_TABLE
        return self._table(path) if path.is_file() else None

    @property
    def scene_picture(self) -> Path | None:
        """Spectrograms of the same, if the run has them."""
        path = self.run / SCENE_PICTURE
        return path if path.is_file() else None

    @cached_property
    def kept(self) -> dict[str, Any]:
        """Rows of `carillon benchmark` that are kept, by name."""
        return json.loads(MEASURED.read_text(encoding="utf-8"))  # type: ignore[no-any-return]

    @property
    def forests_bytes(self) -> int | None:
        """Size of the forests that come with the package; None if they are not there."""
        file = default_forests.DEFAULT_FILE
        return file.stat().st_size if file.is_file() else None

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of the measurements that are kept."""
        return {f"{MEASURED.name}: {name}": row["provenance"] for name, row in self.kept.items()}

    def named(self, path: Path) -> str:
        """A file as the page names it: below the run, or below the checkout."""
        for folder in (self.run, settings.FOLDER.parent):
            if path.is_relative_to(folder):
                return str(path.relative_to(folder))
        return path.name

    def _table(self, path: Path) -> Table:
        name = self.named(path)
        if name not in self.read:
            self.read[name] = read_table(path) if path.suffix == ".json" else read_csv_table(path)
        return self.read[name]
