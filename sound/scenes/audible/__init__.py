"""What contacts do to the modes of bodies, and what two ears hear of it."""
