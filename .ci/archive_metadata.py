"""Writes what archives read about the project: `python .ci/archive_metadata.py`.

codemeta.json and .zenodo.json are made from CITATION.cff, pyproject.toml and the files of
requirements that it names; a test fails while they differ. Sources: CodeMeta 3.0
(https://w3id.org/codemeta/3.0), and the deposit metadata of Zenodo
(https://developers.zenodo.org/#representation), which takes the version from the tag of a release.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
CODEMETA, ZENODO = "codemeta.json", ".zenodo.json"


def texts(root: Path = ROOT) -> dict[str, str]:
    """Content of both files, by name."""
    citation = yaml.safe_load((root / "CITATION.cff").read_text())
    package = tomllib.loads((root / "pyproject.toml").read_text())
    files = package["tool"]["setuptools"]["dynamic"]["dependencies"]["file"]
    needs = [need for name in files for need in _requirements((root / name).read_text())]
    documents = {CODEMETA: codemeta(citation, package["project"], needs), ZENODO: zenodo(citation)}
    return {
        name: json.dumps(document, indent=2, ensure_ascii=False) + "\n"
        for name, document in documents.items()
    }


def codemeta(
    citation: Mapping[str, Any], project: Mapping[str, Any], needs: list[Requirement]
) -> dict[str, Any]:
    """The software as CodeMeta describes it."""
    paper = citation["preferred-citation"]
    return {
        "@context": "https://w3id.org/codemeta/3.0",
        "@type": "SoftwareSourceCode",
        "name": citation["title"],
        "description": citation["abstract"],
        "version": citation["version"],
        "license": f"https://spdx.org/licenses/{citation['license']}",
        "author": [_agent(author) for author in citation["authors"]],
        "keywords": citation["keywords"],
        "programmingLanguage": "Python",
        "runtimePlatform": f"Python {project['requires-python']}",
        "operatingSystem": "Linux",
        "softwareRequirements": [
            {"@type": "SoftwareApplication", "name": need.name, "version": str(need.specifier)}
            for need in needs
        ],
        "referencePublication": {
            "@type": "schema:ScholarlyArticle",
            "name": paper["title"],
            "author": [_agent(author) for author in paper["authors"]],
            "datePublished": str(paper["year"]),
            "isPartOf": paper["conference"]["name"],
        },
    }


def zenodo(citation: Mapping[str, Any]) -> dict[str, Any]:
    """The software as a deposit of Zenodo."""
    return {
        "upload_type": "software",
        "title": citation["title"],
        "description": citation["abstract"],
        "creators": [_creator(author) for author in citation["authors"]],
        "keywords": citation["keywords"],
        "license": citation["license"],
        "access_right": "open",
        "references": [_reference(citation["preferred-citation"])],
    }


def _requirements(text: str) -> list[Requirement]:
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    return [Requirement(line) for line in lines if line]


def _agent(author: Mapping[str, str]) -> dict[str, str]:
    if "name" in author:
        return {"@type": "Organization", "name": author["name"]}
    return {
        "@type": "Person",
        **({"@id": author["orcid"]} if "orcid" in author else {}),
        "givenName": author["given-names"],
        "familyName": author["family-names"],
    }


def _creator(author: Mapping[str, str]) -> dict[str, str]:
    if "name" in author:
        return {"name": author["name"]}
    orcid = author.get("orcid", "").rpartition("/")[2]
    return {"name": _inverted(author), **({"orcid": orcid} if orcid else {})}


def _inverted(author: Mapping[str, str]) -> str:
    return f"{author['family-names']}, {author['given-names']}"


def _reference(paper: Mapping[str, Any]) -> str:
    authors = "; ".join(map(_inverted, paper["authors"]))
    return f"{authors} ({paper['year']}). {paper['title']}. {paper['conference']['name']}."


if __name__ == "__main__":
    for name, text in texts().items():
        (ROOT / name).write_text(text)
