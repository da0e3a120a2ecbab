"""How the solver scales over ranks: measured where there are cores, modelled beyond."""

from solver.studies.scaling.measure import measure
from solver.studies.scaling.study import ScalingOptions, scaling_study, study_lines
