"""What shows that a spectrum is right: residuals, audits, comparison with another."""
