"""Pictures by matplotlib: the formats of their files, solids and their modes."""
