"""From contacts to the sound at two ears."""
