"""The metadata of a crate: RO-Crate 1.1, by the profile Workflow Run Crate 0.5.

Sources: https://w3id.org/ro/crate/1.1, https://w3id.org/ro/wfrun/workflow/0.5 and
https://w3id.org/workflowhub/workflow-ro-crate/1.0.
"""

from __future__ import annotations

import hashlib
import json
import mimetypes
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from carillon.errors import UserError
from workflow.crate.archive import Copied
from workflow.crate.citation import is_person, name_of
from workflow.crate.contents import SNAKEFILE, Role
from workflow.crate.origins import Origin, unicode_of
from workflow.crate.readme import readme_of

if TYPE_CHECKING:
    from rocrate.model import ContextEntity, File
    from rocrate.rocrate import ROCrate

README, METADATA = "README.md", "ro-crate-metadata.json"
REQUIREMENTS = "workflow/envs/requirements-workflow.txt"
PROFILES = {
    "Process Run Crate": "https://w3id.org/ro/wfrun/process/0.5",
    "Workflow Run Crate": "https://w3id.org/ro/wfrun/workflow/0.5",
    "Workflow RO-Crate": "https://w3id.org/workflowhub/workflow-ro-crate/1.0",
}
"""Profiles of RO-Crate that a crate conforms to, with their versioned identifiers."""
TERMS = "https://w3id.org/ro/terms/workflow-run/context"
"""Context that knows `sha256`."""
BIOSCHEMAS = "https://bioschemas.org/profiles/ComputationalWorkflow/1.0-RELEASE"
FORMATS = {
    ".h5": "application/x-hdf5",
    ".yaml": "application/yaml",
    ".smk": "text/plain",
    ".log": "text/plain",
    ".md": "text/markdown",
    ".tsv": "text/tab-separated-values",
}
"""Media types by ending that Python does not know everywhere."""


@dataclass(frozen=True)
class Description:
    """What a crate says about a run as a whole."""

    title: str
    configuration: str
    """Hash of the run's configuration."""
    software: Mapping[str, Any]
    """Keys and values of CITATION.cff."""
    creator: str | None
    """Name of whoever has made the run; the authors of the software if None."""
    licence: str
    """SPDX identifier, for the crate."""


def require_rocrate() -> None:
    """Raise UserError unless the package that writes metadata is installed."""
    try:
        import rocrate  # noqa: F401
    except ImportError:
        raise UserError(
            "crates need the package rocrate, which is not installed; "
            f"install it by pip install -r {REQUIREMENTS}, or 'carillon[workflow]'"
        ) from None


def texts_of(
    files: Sequence[Copied], origins: Mapping[str, Origin], about: Description
) -> dict[str, str]:
    """Texts of a crate's README.md and metadata, by their names.

    `origins` are by the name of the file in the crate.
    """
    from rocrate.rocrate import ROCrate

    readme = readme_of(about.title, about.licence, about.software)
    graph = _Graph(ROCrate(version="1.1"), about)
    entities = {each.file.name: graph.file(each) for each in files}
    moments = {each.file.name: _moment(each.modified) for each in files}
    graph.describe_root(max(moments[each.file.name] for each in files if each.file.is_result))
    graph.add_readme(readme)
    graph.add_run(files, entities)
    for name, origin in origins.items():
        graph.add_command(entities[name], origin, moments[name])
    document = graph.crate.metadata.generate()
    document["@graph"] = [_compact(entity) for entity in document["@graph"]]
    metadata = json.dumps(document, indent=1, ensure_ascii=False, sort_keys=True)
    return {README: readme, METADATA: metadata + "\n"}


class _Graph:
    """A crate that grows entity by entity."""

    def __init__(self, crate: ROCrate, about: Description) -> None:
        self.crate, self.about = crate, about
        self.crate.metadata.extra_contexts.append(TERMS)
        self.authors = [self._agent(each) for each in about.software["authors"]]
        named = about.creator
        self.creators = self.authors if named is None else [self._agent({"given-names": named})]

    def entity(self, uri: str, kind: str, /, **properties: Any) -> ContextEntity:
        """Add what is no file."""
        from rocrate.model import ContextEntity

        entity = ContextEntity(self.crate, uri, {"@type": kind, **properties})
        return self.crate.add(entity)

    def _agent(self, author: Mapping[str, str]) -> ContextEntity:
        name, kind = name_of(author), "Person" if is_person(author) else "Organization"
        own = f"#{kind.lower()}-{quote(name)}"
        return self.entity(author.get("orcid", own), kind, name=name)

    def file(self, copied: Copied) -> File:
        """Add a file."""
        source = copied.file
        properties: dict[str, Any] = {
            "name": PurePosixPath(source.name).name,
            "contentSize": str(copied.size),
            "sha256": copied.sha256,
            "dateModified": _moment(copied.modified),
            "encodingFormat": _format(source.name),
        }
        if source.original and source.original != source.name:
            properties["alternateName"] = unicode_of(source.published_original)
        if source.name != SNAKEFILE:
            return self.crate.add_file(dest_path=source.name, properties=properties)
        software = self.about.software
        properties |= {
            "name": f"{software['title']}: {software['abstract'].rstrip('.')}",
            "version": software["version"],
            "creator": self.authors,
            "author": self.authors,
            "license": self._licence(software["license"]),
            "conformsTo": self.entity(
                BIOSCHEMAS, "CreativeWork", name="Bioschemas ComputationalWorkflow", version="1.0"
            ),
        }
        return self.crate.add_workflow(
            dest_path=source.name, properties=properties, main=True, lang="snakemake"
        )

    def _licence(self, spdx: str) -> ContextEntity:
        identifier = f"https://spdx.org/licenses/{spdx}"
        return self.entity(identifier, "CreativeWork", name=spdx, identifier=spdx)

    def describe_root(self, published: str) -> None:
        """Say what the crate is as a whole."""
        root, software = self.crate.root_dataset, self.about.software
        root["name"] = self.about.title
        root["description"] = (
            f"Rules, configuration, inputs and results of a run of {software['title']} "
            f"{software['version']}. {software['abstract']}"
        )
        root["datePublished"] = published
        root["license"] = self._licence(self.about.licence)
        root["author"] = root["creator"] = self.creators
        root["keywords"] = ", ".join(software["keywords"])
        root["conformsTo"] = [
            self.entity(uri, "CreativeWork", name=name, version=uri.rpartition("/")[2])
            for name, uri in PROFILES.items()
        ]
        root["mentions"] = []

    def add_readme(self, text: str) -> None:
        """Add the page for people."""
        content = text.encode()
        properties = {
            "name": README,
            "about": self.crate.root_dataset,
            "contentSize": str(len(content)),
            "sha256": hashlib.sha256(content).hexdigest(),
            "encodingFormat": _format(README),
        }
        self.crate.add_file(dest_path=README, properties=properties)

    def add_run(self, files: Sequence[Copied], entities: Mapping[str, File]) -> None:
        """Say that the workflow has made the results, from its configuration and inputs."""

        def of(*roles: Role) -> list[File]:
            return [entities[each.file.name] for each in files if each.file.role in roles]

        workflow, results = entities[SNAKEFILE], of(Role.RESULT)
        workflow["hasPart"] = [each for each in of(Role.RULES) if each is not workflow]
        last = max(each.modified for each in files if each.file.is_result)
        self._act(
            "#run",
            f"Run of the workflow: {self.about.title}",
            f"snakemake with the configuration {self.about.configuration}",
            workflow,
            results,
            _moment(last),
            object=of(Role.CONFIGURATION, Role.INPUT),
        )
        for trace in of(Role.TRACE):
            trace["about"] = self.crate.get("#run")
        self._add_parameters(workflow, "input", of(Role.CONFIGURATION), "configfile")
        self._add_parameters(workflow, "input", of(Role.INPUT), "files of models")
        self._add_parameters(workflow, "output", results, "results_dir")

    def _add_parameters(self, workflow: File, way: str, files: Iterable[File], name: str) -> None:
        files = list(files)
        if files:
            parameter = self.entity(
                f"#{quote(name)}",
                "FormalParameter",
                name=name,
                additionalType="File",
                workExample=files,
            )
            workflow.append_to(way, parameter)
            for file in files:
                file["exampleOfWork"] = parameter

    def add_command(self, file: File, origin: Origin, moment: str) -> None:
        """Say which command has made a file, by which versions on which machine."""
        self._act(
            f"#made-{file.id}",
            f"Carillon makes {file['name']}",
            f"{origin.command} ({origin.machine}; commit {origin.commit})",
            self._software(origin),
            [file],
            origin.date or moment,
        )

    def _act(
        self,
        identifier: str,
        name: str,
        description: str,
        instrument: Any,
        result: list[File],
        end: str,
        **more: Any,
    ) -> None:
        action = self.entity(
            identifier,
            "CreateAction",
            name=name,
            description=description,
            instrument=instrument,
            result=result,
            endTime=end,
            agent=self.creators[0],
            **more,
        )
        self.crate.root_dataset.append_to("mentions", action)

    def _software(self, origin: Origin) -> ContextEntity:
        """Carillon as it was used, with the packages that it needs."""
        versions = dict(origin.versions)
        own = versions.pop("carillon", self.about.software["version"])
        start = f"#carillon-{own}-{origin.commit}"
        needed = [self._package(name, version) for name, version in versions.items()]
        identifiers = [each.id for each in needed]
        number, identifier = 1, start
        while (known := self.crate.get(identifier)) is not None:
            if [each.id for each in known["softwareRequirements"]] == identifiers:
                return known
            number += 1
            identifier = f"{start}-{number}"
        return self.entity(
            identifier,
            "SoftwareApplication",
            name=self.about.software["title"],
            softwareVersion=own,
            identifier=origin.commit,
            softwareRequirements=needed,
        )

    def _package(self, name: str, version: str) -> ContextEntity:
        uri = f"https://pypi.org/project/{quote(name)}/{quote(version)}/"
        if name == "python":
            uri = f"https://docs.python.org/release/{quote(version)}/"
        known = self.crate.get(uri)
        if known is not None:
            return known
        return self.entity(uri, "SoftwareApplication", name=name, softwareVersion=version, url=uri)


def _compact(entity: Mapping[str, Any]) -> dict[str, Any]:
    """An entity whose lists of one value are that value, as RO-Crate recommends."""
    alone = {key: value[0] for key, value in entity.items() if _is_single(value)}
    return {**entity, **alone}


def _is_single(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 1


def _moment(seconds: float) -> str:
    """ISO 8601, in UTC and whole seconds."""
    return datetime.fromtimestamp(int(seconds), UTC).isoformat()


def _format(name: str) -> str:
    """Media type of a file by its name."""
    suffix = PurePosixPath(name).suffix.lower()
    return FORMATS.get(suffix) or mimetypes.guess_type(name)[0] or "text/plain"
