"""The study that chooses the fit objective by the spectra it leads to."""
