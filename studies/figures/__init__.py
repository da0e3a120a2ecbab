"""The paper's Fig. 10 and 11 and the scaling over ranks, in full and on a page of their own."""

NEEDS = ("benchmark", "convergence", "scaling")

PAGES = {
    "figures": "the paper's Fig. 10 and 11 and the scaling over ranks, in full",
}
