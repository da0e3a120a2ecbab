"""Scenes: solids that fall, roll and strike each other, and how that sounds."""
