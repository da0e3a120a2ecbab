"""What the paper claims, what is measured here, and why: one table and its page."""
