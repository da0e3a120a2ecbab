"""What objects show of themselves in a notebook: HTML that needs no network and no package."""
