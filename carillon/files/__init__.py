"""Files: names, atomic writing, HDF5, YAML, locks, where results come from."""
