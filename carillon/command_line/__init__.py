"""Commands: their options, how they end, what they print."""
