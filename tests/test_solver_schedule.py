"""Which ranks make which merge of the component mode synthesis."""

import numpy as np
import pytest

from solver.distribution.tree import Merge, MergeTree, assign_ranks
from solver.hcms import schedule as scheduling
from solver.hcms.counts import eigen_flops
from solver.hcms.distributed_products import row_slices
from solver.hcms.scalapack import BLOCK, available, grid_side, places
from solver.hcms.schedule import Schedule, planned_modes, schedule


def balanced_tree(levels: int) -> MergeTree:
    parts = 1 << levels
    merges: list[Merge] = []
    below = list(range(parts))
    while len(below) > 1:
        pairs = zip(below[::2], below[1::2], strict=True)
        joined = [Merge(parts + len(merges) + i, *pair) for i, pair in enumerate(pairs)]
        merges += joined
        below = [merge.group for merge in joined]
    return MergeTree(parts, tuple(merges))


def plan(levels: int, ranks: int, keep: int, nodes: list[float] | None = None) -> tuple:
    tree = balanced_tree(levels)
    nodes = nodes or [600.0] * tree.parts
    nodes = [sum(nodes[start:stop]) for start, stop in tree.ranges()]
    owner = assign_ranks(np.array(nodes[: tree.parts]) ** 1.5, ranks)
    return tree, owner, nodes, schedule(tree, owner, nodes, keep)


def busiest(tree: MergeTree, nodes: list[float], plan: Schedule, keep: int, ranks: int) -> float:
    """Operations of the eigenproblems of the rank that has most of them."""
    modes = planned_modes(tree, nodes, keep)
    flops = np.zeros(ranks)
    for step, team in zip(tree.merges, plan.teams, strict=True):
        flops[list(team)] += eigen_flops(modes[step.left] + modes[step.right], True) / len(team)
    return float(flops.max())


@pytest.mark.parametrize("ranks", [1, 2, 3, 5, 8, 16])
def test_every_merge_is_made_by_someone_who_has_or_gets_its_groups(ranks):
    tree, owner, _, found = plan(4, ranks, 200)
    assert found.holder[: tree.parts] == tuple(owner)
    for number, (step, team) in enumerate(zip(tree.merges, found.teams, strict=True)):
        sides = {found.holder[step.left], found.holder[step.right]}
        assert team[0] == found.holder[step.group]
        assert len(sides) == 1 or team[0] in sides
        everyone = [*team, *found.crews[number][0], *found.crews[number][1]]
        assert len(set(team)) == len(team)
        assert found.ranks_of(number, step) == {*sides, *everyone} <= set(range(ranks))


def test_merges_at_one_level_are_on_different_ranks():
    tree, _, _, found = plan(6, 8, 400)
    levels = tree.levels()
    for level in range(4, 7):
        teams = [
            team
            for step, team in zip(tree.merges, found.teams, strict=True)
            if levels[step.group] == level
        ]
        assert len({rank for team in teams for rank in team}) == sum(map(len, teams))
        assert len(teams) == 1 << (6 - level)


def made_elsewhere(tree: MergeTree, found: Schedule) -> list[Merge]:
    """Merges of groups of one rank that another makes."""
    return [
        step
        for step in tree.merges
        if found.holder[step.left] == found.holder[step.right] != found.holder[step.group]
    ]


def test_an_idle_rank_takes_merges_of_a_busy_one_if_they_are_large():
    # Three quarters of the merges are on the first rank, which has as much of the subdomains.
    uneven = [200.0] * 12 + [1600.0] * 4
    tree, owner, nodes, found = plan(4, 2, 1200, uneven)
    assert made_elsewhere(tree, found)
    stay = Schedule(
        (*map(int, owner), *(int(owner[start]) for start, _ in tree.ranges()[tree.parts :])),
        tuple((int(owner[start]),) for start, _ in tree.ranges()[tree.parts :]),
        found.crews,
        found.exchanges,
    )
    assert busiest(tree, nodes, found, 1200, 2) < busiest(tree, nodes, stay, 1200, 2)
    tree, _, _, found = plan(4, 2, 100, uneven)
    assert not made_elsewhere(tree, found)


@pytest.mark.parametrize("keep", [60, 600, 2400])
@pytest.mark.parametrize("ranks", [2, 4, 8, 16])
def test_a_rank_that_has_as_much_to_do_as_the_others_makes_its_own_merges(ranks, keep):
    tree, owner, _, found = plan(5, ranks, keep)
    assert not made_elsewhere(tree, found)
    across = [step for step in tree.merges if found.holder[step.left] != found.holder[step.right]]
    assert len(across) == ranks - 1


def test_large_merges_are_shared_and_small_ones_are_not(monkeypatch):
    *_, small = plan(4, 16, 60)
    assert all(len(team) == 1 for team in small.teams)
    *_, large = plan(4, 16, 4800)
    assert len(large.teams[-1]) == (16 if available() else 1)
    *_, wide = plan(4, 16, 300, [200_000.0] * 16)
    assert len(wide.crews[-1][0]) == len(wide.crews[-1][1]) == 7
    monkeypatch.setattr(scheduling, "available", lambda: False)
    assert all(len(team) == 1 for team in plan(4, 16, 4800)[-1].teams)


@pytest.mark.parametrize("ranks", [1, 4, 9])
def test_every_entry_lies_on_one_rank(ranks):
    owner = np.zeros((3 * BLOCK + 5,) * 2, dtype=int)
    for rank in range(ranks):
        owner[np.ix_(*places(len(owner), rank, ranks))] += 1
    assert (owner == 1).all()
    assert grid_side(ranks) ** 2 == ranks


def test_rows_are_shared_evenly():
    sizes = [each.stop - each.start for each in row_slices(17, 5)]
    assert sum(sizes) == 17 and max(sizes) - min(sizes) <= 1
