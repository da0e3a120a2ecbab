"""Fig. 9: forests compared with other coarsenings of single blocks, and what the errors are."""
