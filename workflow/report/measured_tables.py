"""Benchmark tables with the conditions that they were measured under: Fig. 10, 11 and scaling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

from workflow.report import convergence_tables, methods_tables, scaling_tables
from workflow.report.conditions import NOT_TIMED, Repeats, conditions
from workflow.report.table import Table


class Measured(Protocol):
    """Folder of results with the output of `solver benchmark`, `convergence` and `scaling`."""

    @property
    def config(self) -> dict[str, Any]:
        """The resolved configuration."""

    @property
    def titles(self) -> dict[str, str]:
        """Names of the solids for people."""

    @property
    def methods(self) -> dict[str, dict[str, Any]]:
        """Output of `solver benchmark` by solid."""

    @property
    def convergence(self) -> dict[str, dict[str, Any]]:
        """Output of `solver convergence` by solid."""

    @property
    def scaling(self) -> dict[str, dict[str, Any]]:
        """Output of `solver scaling` by solid."""


def methods(results: Measured) -> Table:
    """Fig. 11: a row a solid, a column a method."""
    return _timed(methods_tables.methods(results.methods, results.titles), results)


def spreads(results: Measured) -> Table:
    """Fig. 11: a row a solid and method."""
    return _timed(methods_tables.spreads(results.methods, results.titles), results)


def ratios(results: Measured) -> Table:
    """Speed-ups, each with its base."""
    return _timed(methods_tables.ratios(results.methods, results.titles), results)


def convergence(results: Measured) -> Table:
    """Fig. 10."""
    table = convergence_tables.convergence(results.convergence, results.titles)
    return _under(table, results.convergence, results, NOT_TIMED)


def scaling(results: Measured) -> Table:
    """Wall time over ranks."""
    table = scaling_tables.scaling(results.scaling, results.titles)
    return _under(table, results.scaling, results, scaling_tables.repeats(results.scaling))


def _timed(table: Table, results: Measured) -> Table:
    return _under(table, results.methods, results, methods_tables.repeats(results.methods))


def _under(
    table: Table, found: Mapping[str, dict[str, Any]], results: Measured, repeats: Repeats
) -> Table:
    records = {model: result["provenance"] for model, result in found.items()}
    return replace(table, conditions=conditions(records, results.config, repeats))
