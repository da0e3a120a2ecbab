"""Motion and sound after a strike, to compare spectra by what they do."""
