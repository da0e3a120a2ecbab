"""All studies that have a page: those of the folders in `studies`, the report, the validation."""

from functools import cache
from importlib import import_module

import studies
from studies.base.cases import CaseStudy
from studies.base.study import Study, no_files

OF_THE_RUN = ("workflow.report", "workflow.validation")
"""Packages of the main chain that are made of tables, figures and a page as studies are."""


@cache
def all_studies() -> dict[str, Study]:
    """All of them by name."""
    packages = [*OF_THE_RUN, *(f"studies.{name}" for name in studies.names_with("study.py"))]
    modules = [import_module(f"{package}.study") for package in packages]
    values = [each for module in modules for each in vars(module).values()]
    return {study.name: study for study in values if isinstance(study, Study)}


def of_cases() -> list[CaseStudy]:
    """Those that measure case by case."""
    return [study for study in all_studies().values() if isinstance(study, CaseStudy)]


def in_steps() -> list[Study]:
    """Those whose tables, figures and page are made by one rule after the other."""
    return [study for study in all_studies().values() if study.measured is not no_files]
