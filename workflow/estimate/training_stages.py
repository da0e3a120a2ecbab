"""Stages of a training: data, trees, leaves, and the table of errors on single blocks."""

from __future__ import annotations

from dataclasses import dataclass

from dataset_gen.tasks import ROW
from forests.comparison.combinations import combinations
from forests.training.moments import ENTRIES
from workflow import training
from workflow.estimate.machine import Jobs
from workflow.estimate.stages import MEGABYTE, Run, Stage

ORIGINS = 8
"""Rows of a sample, one for each corner of the block."""

BYTES_PER_LEAF = 56
"""A leaf in the forests, with its share of the splits."""

SUM_BYTES = 8 * (ENTRIES + 3)
"""A leaf's sums while the leaves are fitted."""

UNIT_LEAVES = 1000
"""Leaves of a tree that the rate of adding rows is for."""

LONG, SHORT = 24 * 3600.0, 3600.0
"""A job of more than the first is too long [s], one of the second is a good one."""

LEAST_LEAF = 4
"""Rows of a leaf of a tree that ends for want of rows, as a multiple of `min_leaf`."""


@dataclass(frozen=True)
class TrainingStages:
    """Stages of the training of the run's own forests."""

    run: Run

    @property
    def plan(self) -> training.Training:
        """Data and training."""
        return training.own(self.run.config)

    @property
    def samples(self) -> int:
        """Samples of the dataset."""
        return int(self.plan.dataset["samples"])

    @property
    def structure_rows(self) -> int:
        """Rows that splits are chosen from."""
        return min(int(self.plan.forests["structure_rows"]), ORIGINS * self.samples)

    @property
    def leaves(self) -> int:
        """Leaves of a tree: as many as are allowed, or as the rows suffice for."""
        wanted = self.plan.forests
        enough = self.structure_rows // (LEAST_LEAF * wanted["min_leaf"])
        return int(max(2, min(wanted["max_leaves"], enough)))

    @property
    def forests_mb(self) -> float:
        """Storage of the forests."""
        return BYTES_PER_LEAF * len(self.plan.trees) * self.leaves / MEGABYTE

    @property
    def sample_seconds(self) -> float:
        """Seconds of one core for a sample: drawn, fitted and written."""
        rates, objective = self.run.rates, self.plan.dataset["objective"]
        return 1.0 / rates.fits_per_second[objective] + rates.numbers["draw_seconds"]

    def stages(self) -> list[Stage]:
        """All stages, in order."""
        return [self.data(), self.growing(), self.fitting(), self.table()]

    def data(self) -> Stage:
        """Shards, written and then read once."""
        run, numbers, dataset = self.run, self.run.numbers, self.plan.dataset
        shards, workers = len(self.plan.shards), run.machine.granted(dataset["workers"])
        each = self.samples / shards
        start, memory = numbers["fitting_start_seconds"], numbers["fitting_mb"]
        written = Jobs(
            shards, start + each * self.sample_seconds / workers, workers, workers * memory
        )
        read = Jobs(shards, start + each * numbers["inspect_seconds"], 1, memory)
        at_a_time = min(shards, run.machine.slots(workers))
        how = run.rates.how["data"]
        basis = {
            "seconds": f"{shards} shards of {each:,.0f} samples, {1e6 * self.sample_seconds:.3g} "
            f"us each on a core by objective {dataset['objective']}, then "
            f"{1e6 * numbers['inspect_seconds']:.2g} us to read; {how}",
            "memory": f"{memory:.0f} MB for each of {workers} processes, however many samples; "
            f"{how}",
            "files": f"{numbers['shard_bytes']:.0f} bytes a sample in its shard, measured; while "
            f"{at_a_time} shards are written, {ROW.itemsize} bytes a sample in their journals",
        }
        kept = self.samples * numbers["shard_bytes"] / MEGABYTE
        journals = at_a_time * each * ROW.itemsize / MEGABYTE
        cautions = self._too_long(written)
        return Stage("data generation", "all", (written, read), basis, kept, journals, cautions)

    def _too_long(self, shard: Jobs) -> tuple[str, ...]:
        """What to do if a shard takes days."""
        if shard.seconds <= LONG:
            return ()
        better = round(self.plan.dataset["shards"] * shard.seconds / SHORT)
        return (
            f"data generation: one shard takes {shard.seconds / 3600.0:,.0f} h; with "
            f"dataset.shards: {better:,} each takes one, and more of them run at a time",
        )

    def growing(self) -> Stage:
        """Trees, each on one core; a rank holds the rows once for all its trees."""
        run, numbers, rows = self.run, self.run.numbers, self.structure_rows
        ranks, trees = self.plan.forests["ranks"], len(self.plan.trees)
        cores = run.cores(ranks)
        at_a_time = min(ranks if ranks > 1 else cores, trees)
        per_row = numbers["growing_seconds_per_row"]
        per_leaf = numbers["growing_seconds_per_leaf"]
        tree = per_row * rows + per_leaf * self.leaves
        seconds = numbers["start_seconds"] + -(-trees // at_a_time) * tree
        row_bytes = numbers["growing_bytes_per_row"]
        memory = ranks * (numbers["training_mb"] + row_bytes * rows / MEGABYTE)
        how = run.rates.how["trees"]
        basis = {
            "seconds": f"{trees} trees, {at_a_time} at a time, {1e6 * per_row:.2g} us for each of "
            f"{rows:,} rows and {1e3 * per_leaf:.2g} ms for each of {self.leaves:,} leaves; {how}",
            "memory": f"{row_bytes:.0f} bytes a row on each of {ranks} ranks; {how}",
            "files": "none of its own",
        }
        cautions = (
            *run.beyond("growing trees", rows, "rows", "seconds and memory"),
            *run.beyond("growing trees", self.leaves, "leaves", "seconds"),
        )
        jobs = (Jobs(1, seconds, cores, memory, ranks),)
        return Stage("growing trees", "all", jobs, basis, cautions=cautions)

    def fitting(self) -> Stage:
        """Leaves: rows are prepared by one process of a rank and added by as many as trees."""
        run, numbers = self.run, self.run.numbers
        ranks, trees = self.plan.forests["ranks"], len(self.plan.trees)
        cores, rows = run.cores(ranks), ORIGINS * self.samples
        growth = (self.leaves / UNIT_LEAVES) ** numbers["leaf_growth"]
        add = self.plan.forests["trees"] * numbers["leaf_seconds_per_row"] * growth
        prepare = numbers["prepare_seconds_per_row"]
        if ranks > 1 or cores == 1:
            per_row = (prepare + add) / ranks
        else:
            per_row = max(prepare, add / min(cores, trees))
        regression = numbers["leaf_bytes"] * self.leaves
        sums = SUM_BYTES * trees * self.leaves
        memory = ranks * (numbers["training_mb"] + (sums + regression) / MEGABYTE)
        how = run.rates.how["leaves"]
        basis = {
            "seconds": f"{rows:,} rows, {1e6 * prepare:.2g} us each to prepare and "
            f"{1e6 * add:.2g} us to add to {trees // 2} trees of {self.leaves:,} leaves, on "
            f"{ranks} ranks; {how}",
            "memory": f"{SUM_BYTES} bytes for each leaf of all trees and "
            f"{numbers['leaf_bytes']:.0f} for each of one, on each of {ranks} ranks; {how}",
            "files": f"{BYTES_PER_LEAF} bytes for each leaf of {trees} trees",
        }
        return Stage(
            "fitting leaves",
            "all",
            (Jobs(1, per_row * rows, cores, memory, ranks),),
            basis,
            self.forests_mb,
            cautions=(*run.beyond("fitting leaves", self.leaves, "leaves", "seconds"),),
            continues=True,
        )

    def table(self) -> Stage:
        """Errors of the forests and their rivals on single blocks."""
        run, numbers, wanted = self.run, self.run.numbers, self.plan.forests
        combined = combinations(wanted["materials"])
        seconds = numbers["start_seconds"]
        seconds += numbers["table_seconds_per_block"] * wanted["blocks"]
        seconds += numbers["table_seconds_per_combination"] * combined
        how = run.rates.how["table"]
        basis = {
            "seconds": f"{wanted['blocks']:,} blocks of each kind and {combined:,} combinations of "
            f"{wanted['materials']} materials, on one of its cores; {how}",
            "memory": f"{numbers['table_mb']:.0f} MB and the forests; {how}",
            "files": "some kilobytes, not counted",
        }
        jobs = (Jobs(1, seconds, run.cores(1), numbers["table_mb"] + self.forests_mb),)
        return Stage("errors on single blocks", "all", jobs, basis)
