"""Modal analyses of a search, counted in whatever process they are made (test support)."""

from dataclasses import dataclass, fields, replace
from pathlib import Path

from sound.design.simulation import TOLERANCE, Simulation
from sound.design.tasks import Setting


@dataclass(frozen=True, kw_only=True)
class CountedSetting(Setting):
    """A setting whose search adds a byte to the file `count` for every analysis."""

    count: Path

    def simulation(self, tolerance=TOLERANCE):
        """Its simulation; those to another tolerance check what was found, and do not count."""
        made = super().simulation(tolerance)
        if tolerance == TOLERANCE:
            made.__class__, made.count = _CountedSimulation, self.count
        return made


class _CountedSimulation(Simulation):
    def evaluate(self, *arguments, **options):
        with self.count.open("ab") as file:
            file.write(b".")
        return super().evaluate(*arguments, **options)


def counted(problem, count):
    """The problem, whose search counts its analyses in the file `count`."""
    setting = problem.setting
    own = {field.name: getattr(setting, field.name) for field in fields(setting)}
    count.write_bytes(b"")
    return replace(problem, setting=CountedSetting(**own, count=count))
