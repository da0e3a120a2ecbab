"""Tables of the figures: those of the report that tell the same."""

from workflow.report.convergence_tables import convergence as convergence
from workflow.report.methods_tables import methods as methods
from workflow.report.methods_tables import ratios as ratios
from workflow.report.methods_tables import spreads as spreads
from workflow.report.scaling_tables import scaling as scaling
