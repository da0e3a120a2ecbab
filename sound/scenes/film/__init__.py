"""Films of scenes by ray tracing."""
