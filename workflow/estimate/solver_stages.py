"""Stages of the spectra: truth, other variants, tables, validation, and the figures in full."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from workflow import settings, variants
from workflow.estimate.composition import Composition
from workflow.estimate.machine import Jobs
from workflow.estimate.sizes import Size, Sizes, Solid
from workflow.estimate.stages import MEGABYTE, Run, Stage

TRACED_STEPS = 3
"""Corrections of the convergence history that was measured."""
AUDITED = 3
"""Modes files that the audit and the response were measured on."""
NUMBER_BYTES = 8
UNCOUNTED = {"files": "some megabytes of pictures and tables, not counted"}


@dataclass(frozen=True)
class SolverStages:
    """Stages of the spectra of all models; `sizes` finds the unknowns of a solid."""

    run: Run
    sizes: Sizes

    def stages(self) -> list[Stage]:
        """All stages, in order."""
        return [self.truth(), self.others(), self.report(), self.validation(), self.figures()]

    def model_size(self, name: str, resolution: int | None = None) -> Size:
        """Unknowns of a model, at its own resolution unless told."""
        config = self.run.config
        model = config["models"][name]
        mesh = settings.mesh_of(config, name)
        chosen = resolution or model["resolution"]
        return self.sizes(Solid(mesh, chosen, model["fill"], model["components"]))

    def shape_size(self, name: str) -> Size:
        """Unknowns of a solid of the figures, also of one whose mesh is absent."""
        config = self.run.config
        shape = config["figures"]["models"][name]
        mesh = settings.figured_mesh(config, name)
        return self.sizes(Solid(mesh, shape["resolution"], components=shape["components"]))

    @property
    def models(self) -> dict[str, Size]:
        """Unknowns of the models."""
        return {name: self.model_size(name) for name in self.run.config["models"]}

    @property
    def shapes(self) -> dict[str, Size]:
        """Unknowns of the solids of the figures."""
        return {name: self.shape_size(name) for name in self.run.config["figures"]["models"]}

    # Jobs

    def _solver_job(self, seconds: float, memory_mb: float, ranks: int | None = None) -> Jobs:
        """A solver run by its seconds on one core and its memory, both beyond starting."""
        numbers = self.run.numbers
        ranks = self.run.config["solver"]["ranks"] if ranks is None else ranks
        cores, serial = self.run.cores(ranks), self.run.rates.serial_share
        wall = numbers["start_seconds"] + seconds * (serial + (1.0 - serial) / cores)
        return Jobs(1, wall, cores, ranks * numbers["start_mb"] + memory_mb, ranks)

    def _unknowns(self, name: str, variant: str) -> tuple[int, int]:
        """Unknowns and modes of a model's variant."""
        size, fine = self.model_size(name), variants.VARIANTS[variant].coarsen == "none"
        return (size.fine if fine else size.coarse), settings.modes_of(self.run.config, name)

    def _modes_job(self, name: str, variant: str) -> Jobs:
        how = variants.VARIANTS[variant]
        cost = self.run.rates.laws["hcms_ec" if how.corrected else how.method]
        at = self._unknowns(name, variant)
        return self._solver_job(cost.seconds(*at), cost.memory_mb(*at))

    def _modes_mb(self, name: str, variant: str) -> float:
        unknowns, modes = self._unknowns(name, variant)
        return NUMBER_BYTES * unknowns * modes / MEGABYTE

    def _convergence(self, size: Size, modes: int, steps: int) -> Jobs:
        cost = self.run.rates.laws["hcms_ec"]
        share = self.run.numbers["convergence_ratio"] * (1 + steps) / (1 + TRACED_STEPS)
        at = (size.fine, modes)
        return self._solver_job(share * cost.seconds(*at), cost.memory_mb(*at), ranks=1)

    def _timing(self, size: Size, part: Mapping[str, Any]) -> Jobs:
        laws, modes = self.run.rates.laws, part["modes"]
        seconds = Composition(laws).timing(size, modes, part)
        memory = laws["hcms_ec"].memory_mb(size.fine, modes)
        return self._solver_job(self.run.numbers["timing_ratio"] * seconds, memory)

    def _scaling(self, size: Size, part: Mapping[str, Any], weak: bool = False) -> Jobs:
        """Runs on every number of ranks, of one core each; weak ones grow with the ranks."""
        numbers, cost, cores = self.run.numbers, self.run.rates.laws["hcms_ec"], self.run.cores(1)
        runs = [(count, size.fine) for count in part["ranks"]]
        runs += [(count, count * size.fine) for count in part["ranks"] if weak]
        modes = part["modes"]
        seconds = sum(
            numbers["start_seconds"]
            + numbers["scaling_ratio"] * cost.seconds(unknowns, modes) / min(count, cores)
            for count, unknowns in runs
        )
        memory = max(
            count * numbers["start_mb"] + cost.memory_mb(unknowns, modes)
            for count, unknowns in runs
        )
        return Jobs(1, seconds, cores, memory)

    def _reader(self, law: str, name: str, share: float = 1.0) -> Jobs:
        """A program that reads modes of a model on one core."""
        numbers, cost = self.run.numbers, self.run.rates.laws[law]
        at = self._unknowns(name, variants.TRUTH)
        seconds = numbers["start_seconds"] + share * cost.seconds(*at)
        return Jobs(1, seconds, 1, numbers["start_mb"] + share * cost.memory_mb(*at))

    def _small(self, count: int) -> Jobs:
        """Tables, pictures and pages, each about as long as a solver run without work."""
        return Jobs(count, self.run.numbers["start_seconds"], 1, self.run.numbers["start_mb"])

    # Stages

    def truth(self) -> Stage:
        """Ground truth of every model."""
        names = list(self.models)
        return Stage(
            "ground truth",
            "all",
            tuple(self._modes_job(name, variants.TRUTH) for name in names),
            self._basis("slepc", "a run for each model"),
            sum(self._modes_mb(name, variants.TRUTH) for name in names),
            cautions=self._cautions("ground truth", self.models),
        )

    def others(self) -> Stage:
        """All other variants, and the convergence, times and scaling of the run itself."""
        each = [(name, variant) for name in self.models for variant in variants.CANDIDATES]
        jobs = (*(self._modes_job(*pair) for pair in each), *self._shown())
        return Stage(
            "HCMS and other variants",
            "all",
            jobs,
            self._basis("hcms_ec", f"{len(jobs)} runs, the longer ones composed of others"),
            sum(self._modes_mb(*pair) for pair in each),
            cautions=self._cautions("HCMS and other variants", self.models),
        )

    def _shown(self) -> Iterator[Jobs]:
        config = self.run.config
        for name in config["convergence"]["models"]:
            modes = min(config["convergence"]["modes"], settings.modes_of(config, name))
            yield self._convergence(self.model_size(name), modes, config["convergence"]["steps"])
        for name in config["times"]["models"]:
            size = self.model_size(name, config["times"]["resolution"])
            yield self._timing(size, config["times"])
        for name in config["scaling"]["models"]:
            size = self.model_size(name, config["scaling"]["resolution"])
            yield self._scaling(size, config["scaling"])

    def report(self) -> Stage:
        """Comparisons with the truth, tables, pictures and the page of the run."""
        config, rates = self.run.config, self.run.rates
        compared = (
            self._reader("compare", name) for name in self.models for _ in variants.CANDIDATES
        )
        drawn = 3 * len(self.models) + sum(
            len(config[part]["models"]) for part in ("convergence", "scaling")
        )
        whole = 4 + bool(config["times"]["models"]) + (config["forests"]["model"] is None)
        basis = {
            "seconds": "comparisons measured on the modes of a solid, in proportion to unknowns "
            f"and modes; a table or a picture as {rates.how['start']}",
            "memory": f"of the largest comparison, likewise; {rates.how['solver']}",
            **UNCOUNTED,
        }
        jobs = (*compared, self._small(drawn + whole))
        return Stage("tables, pictures, report", "all", jobs, basis)

    def validation(self) -> Stage:
        """Audit, strike and page of every model."""
        share = len(variants.SHOWN) / AUDITED
        jobs = [
            self._reader(law, name, share) for law in ("audit", "respond") for name in self.models
        ]
        basis = {
            "seconds": "an audit in proportion to the unknowns, a response in proportion to "
            f"unknowns and modes, and a page for each model; {self.run.rates.how['solver']}",
            "memory": f"of the largest audit or response, likewise; {self.run.rates.how['solver']}",
            **UNCOUNTED,
        }
        return Stage("validation", "all", (*jobs, self._small(len(self.models))), basis)

    def figures(self) -> Stage:
        """Fig. 10 and 11 and the scaling in full."""
        part, shapes = self.run.config["figures"], self.shapes
        traced = [
            self._convergence(shapes[name], part["modes"], part["steps"])
            for name in part["convergence"]
        ]
        scaled = [self._scaling(shapes[name], part, part["weak"]) for name in part["scaling"]]
        drawn = 3 + len(traced) + len(scaled)
        what = (
            f"{len(shapes)} solids timed in {part['runs']} rounds, {len(traced)} convergence "
            f"histories, {len(scaled)} scalings, all composed of other runs"
        )
        return Stage(
            "figures",
            "figures",
            (
                *(self._timing(size, part) for size in shapes.values()),
                *traced,
                *scaled,
                self._small(drawn),
            ),
            self._basis("slepc", what) | UNCOUNTED,
            cautions=self._cautions("figures", shapes),
        )

    def _basis(self, law: str, runs: str) -> dict[str, str]:
        cost, how = self.run.rates.laws[law], self.run.rates.how["solver"]
        seconds, memory = cost.seconds, cost.memory_mb
        return {
            "seconds": f"{runs}; {law} takes {seconds.factor:.2g} s x "
            f"unknowns^{seconds.unknowns:.2f} x modes^{seconds.modes:.2f} on one core, of which "
            f"{self.run.rates.serial_share:.0%} stays on many; {how}",
            "memory": f"{self.run.numbers['start_mb']:.0f} MB a rank and, for {law}, "
            f"{memory.factor:.2g} MB x unknowns^{memory.unknowns:.2f} x "
            f"modes^{memory.modes:.2f}; {how}",
            "files": "8 bytes for each unknown and mode",
        }

    def _cautions(self, stage: str, sizes: Mapping[str, Size]) -> tuple[str, ...]:
        largest = max(size.fine for size in sizes.values())
        cores = self.run.cores(self.run.config["solver"]["ranks"])
        return (
            *self.run.beyond(stage, largest, "unknowns", "seconds and memory"),
            *self.run.beyond(stage, cores, "cores", "speed-ups"),
        )
