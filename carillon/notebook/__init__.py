"""Displays of objects in notebooks: HTML that needs no network and no package."""
