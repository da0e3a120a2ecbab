"""The film of a scene, traced by rays."""
