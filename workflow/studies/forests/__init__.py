"""The study of the forests: errors on single blocks, ways to train, rows, speed."""
