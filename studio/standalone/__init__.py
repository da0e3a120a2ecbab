"""A page of a finished design that needs no server."""
