"""Who may ask the studio for what, and its answers."""
