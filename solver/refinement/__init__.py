"""How far a coarse model's frequencies are off, which elements are to blame, which stay fine."""
