"""One solid against ground truth: every proof, judged by stated tolerances, on one page."""
