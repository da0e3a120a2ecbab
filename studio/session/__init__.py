"""State of the studio: what is designed, undo and redo, files."""
