"""What all studies share: results that are read when asked for, tables, figures, pages."""
