"""How far single modes of a coarse model are off, why, and whether that is foreseen."""
