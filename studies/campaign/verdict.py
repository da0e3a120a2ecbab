"""The verdict of a campaign for programs: JSON, JUnit's XML, and an exit status.

`python -m studies.campaign.verdict FILE` says it once more: status 1 if a cell failed.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from carillon.records import provenance
from studies.campaign.results import FAILED, PASSED, Campaign, end_of

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd]")
"""Characters that XML cannot hold."""


def as_json(study: Campaign) -> dict[str, Any]:
    """Whether all passed, in a sentence too, and every cell, the worst first."""
    return {
        "passed": study.passed,
        "headline": study.headline,
        "cells": [
            {
                "solid": cell.solid,
                "material": cell.material,
                "seed": cell.seed,
                "ranks": cell.ranks,
                "verdict": end_of(result),
                "reason": result["reason"],
                "missed": [each for each in result["criteria"] if each["verdict"] == "missed"],
                "seconds": result["seconds"],
                "command": result["command"],
            }
            for cell, result in study.found.items()
        ],
        "provenance": provenance.record({"config": study.config}),
    }


def as_junit(study: Campaign) -> str:
    """JUnit's XML: a suite a solid, a test a cell; one that was not run is an error."""
    root = ElementTree.Element("testsuites", name="campaign")
    for solid in study.solids:
        suite = ElementTree.SubElement(root, "testsuite", name=study.titles[solid])
        counts = {"tests": 0, "failures": 0, "errors": 0}
        seconds = 0.0
        for cell, result in study.found.items():
            if cell.solid != solid:
                continue
            end = end_of(result)
            test = ElementTree.SubElement(
                suite,
                "testcase",
                classname=f"campaign.{solid}",
                name=f"{cell.material} seed {cell.seed} ranks {cell.ranks}",
                time=f"{result['seconds']:.3f}",
            )
            counts["tests"] += 1
            seconds += result["seconds"]
            if end != PASSED:
                kind = "error" if end == FAILED else "failure"
                counts["errors" if end == FAILED else "failures"] += 1
                element = ElementTree.SubElement(test, kind, type=end, message=_told(result)[0])
                element.text = "\n".join([*_told(result), result["command"]])
        suite.attrib.update({key: str(value) for key, value in counts.items()})
        suite.set("time", f"{seconds:.3f}")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _told(result: dict[str, Any]) -> list[str]:
    """Why a cell did not pass, a line for each criterion."""
    if result["reason"] is not None:
        return [_NO_XML.sub("?", result["reason"])]
    return [
        f"{each['group']}: {each['label']}: {each['shown']}, required {each['required']}"
        for each in result["criteria"]
        if each["verdict"] == "missed"
    ]


def main(path: str) -> int:
    """Print the headline of a verdict in JSON; returns 0 if all passed, and else 1."""
    verdict = json.loads(Path(path).read_text())
    print(verdict["headline"])
    return 0 if verdict["passed"] else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
