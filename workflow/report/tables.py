"""All tables of a run."""

from workflow.report.blocks_tables import blocks as blocks
from workflow.report.convergence_tables import convergence as convergence
from workflow.report.design_tables import design as design
from workflow.report.forests_tables import training as training
from workflow.report.methods_tables import methods as methods
from workflow.report.methods_tables import ratios as ratios
from workflow.report.methods_tables import spreads as spreads
from workflow.report.scaling_tables import scaling as scaling
from workflow.report.spectra_tables import coarsening as coarsening
from workflow.report.spectra_tables import errors as errors
from workflow.report.spectra_tables import evidence as evidence
from workflow.report.spectra_tables import frequencies as frequencies
from workflow.report.spectra_tables import phases as phases
from workflow.report.spectra_tables import summary as summary
from workflow.report.spectra_tables import times as times
