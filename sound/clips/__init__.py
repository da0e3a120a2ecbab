"""Sound clips: reading and writing WAV, their modes, and synthesised examples."""
