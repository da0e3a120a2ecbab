"""The mesh over the ranks: subdomains, the tree that merges them, and what each rank holds."""
