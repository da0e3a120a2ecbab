"""Studies: results -> tables -> figures -> page, each in a room of its own."""
