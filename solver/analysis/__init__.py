"""Modal analysis by any method, from the names on a command line or from arrays."""
