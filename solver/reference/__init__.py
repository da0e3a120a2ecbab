"""Ground truth: SLEPc and ARPACK, and the proof by an inertia count that no mode is missing."""
