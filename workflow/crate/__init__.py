"""The crate of a run: one ZIP file of its rules, inputs and results, described as RO-Crate."""
