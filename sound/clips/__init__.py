"""Sound clips: reading and writing sound files, their modes, and synthesised examples."""
