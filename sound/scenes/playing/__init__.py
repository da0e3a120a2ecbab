"""From a scene to what is seen and heard of it."""
