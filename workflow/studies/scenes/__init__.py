"""Scenes of designs and bars that fall, roll and strike each other, and their page."""
