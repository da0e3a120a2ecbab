"""Two-step training (section 7.1.3): structure from a subset, leaves from all rows."""
