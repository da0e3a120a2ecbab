"""State of the studio: what is designed, undo and redo, files."""

from studio.session.opening import open_studio as open_studio
