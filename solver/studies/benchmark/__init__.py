"""The time table (Fig. 11): every way to a spectrum on the same solid, machine and cores."""

from solver.studies.benchmark.row import BenchmarkOptions, benchmark_row, row_lines
