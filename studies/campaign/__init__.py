"""Validations of many solids, materials, seeds and ranks, judged together."""

PAGES = {
    "campaign": "validations of solids, materials, seeds and ranks",
}
