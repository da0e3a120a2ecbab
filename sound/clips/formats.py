"""Formats of sound clips that are read, in words."""

CLIP_FORMATS = "WAV, FLAC, Ogg, AIFF or MP3"
"""Formats of clips; the library for sound files reads some rare ones, too."""
A_CLIP = f"a sound clip ({CLIP_FORMATS})"
"""Words for an expected clip in messages about unusable files."""
