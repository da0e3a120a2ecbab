"""From result files to tables, figures and one self-contained page."""
