"""The time table (Fig. 11): every way to a spectrum on the same solid, machine and cores."""

from solver.studies.benchmark.options import BenchmarkOptions
from solver.studies.benchmark.row import benchmark_row, row_lines
