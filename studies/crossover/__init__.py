"""Which method is the fastest where: unknowns, modes, ranks, nodes and tolerances."""

NEEDS = ("scaling",)
PAGES = {
    "crossover": "the fastest method over unknowns, modes, ranks and tolerances",
}
