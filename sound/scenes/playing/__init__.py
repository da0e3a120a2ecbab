"""Scenes played: from a description to motion and sound."""
