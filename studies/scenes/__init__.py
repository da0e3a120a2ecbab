"""Scenes of designs and bars that fall, roll and strike each other, and their page."""

NEEDS = ("sounds",)

PAGES = {
    "scenes": "scenes of solids that fall, roll and strike each other",
}
