"""Error correction of approximate modes (section 7.2.1, Eq. 16-21)."""
