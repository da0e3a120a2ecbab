"""What spectra are worth: compared, audited, timed, scaled, and calibrated."""
