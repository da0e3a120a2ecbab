"""The sections of the main chain: solver, validation, and what the report of a run measures."""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from carillon.parameters import REQUIRED, Within, option, parameters
from carillon.parameters.quantities import (
    Corrections,
    NumberOfUnknowns,
    PoissonRatio,
    Resolution,
    Tolerance,
)
from workflow.configuration.forests import DatasetSection, DefaultForestSection, ForestsSection
from workflow.configuration.resources import LimitsSection
from workflow.configuration.section import (
    CommandLine,
    Distinct,
    File,
    Folder,
    Line,
    RankCounts,
    Ranks,
    RelativeError,
    ResultsFolder,
    Runs,
    Share,
    Title,
    require_named,
)
from workflow.configuration.solids import ModelEntry, ModelModes, Solids

Names = Distinct[Line]
ProvedTolerance = Annotated[
    Tolerance,
    Within("the validation holds spectra to ten times this error", le=0.1),
    "relative eigenvalue error at which error correction stops [1]",
]
MadeCorrections = Annotated[
    Corrections, Within("plain HCMS is beside them as a method of its own", ge=1)
]
Residual = Annotated[float, Gt(0), Le(1.0)]


@parameters
class SolverSection:
    """Modal analysis."""

    modes: ModelModes = option(256, "modes of every model, rigid ones included [1]")
    tolerance: ProvedTolerance = option(1e-7)
    corrections: MadeCorrections = option(40, "most steps of error correction [1]")
    retained_modes: Annotated[NumberOfUnknowns, Ge(12)] | None = option(
        None, "modes kept at the root of the merge tree; the solver's choice if null [1]"
    )
    subdomains: NumberOfUnknowns | None = option(
        None, "subdomains of HCMS; the solver's choice if null [1]"
    )
    interface: Literal["overlapping", "free", "fixed"] = option(
        "overlapping", "interface treatment of HCMS, overlapping, free or fixed"
    )
    acceleration: Literal["lanczos", "krylov", "relaxation"] = option(
        "lanczos",
        "iteration of the error correction, lanczos by block Lanczos, krylov step by step in the "
        "span of modes and corrections, relaxation by the over-relaxed subspace iteration of the "
        "paper",
    )
    linear_solver: Literal["auto", "multifrontal", "mumps", "icc-pcg", "amg-cg"] = option(
        "auto",
        "linear solver of the error correction; auto is the fastest direct one, icc-pcg the "
        "paper's conjugate gradients with incomplete Cholesky factors",
    )
    missed_tolerance: Literal["fail", "keep"] = option(
        "fail",
        "what comes of an error correction that misses its tolerance, fail for none of its "
        "results or keep for spectra as near as it came, which the pages then tell",
    )
    refine_to: Annotated[float, Ge(0), Le(10)] | None = option(
        None,
        "error of frequencies that blocks of the solid coarsened by the forests are kept fine "
        "for; 0 keeps none fine, null leaves it to the solver [1]",
    )
    ranks: Ranks = option(1, "MPI ranks of every solver run; cores are shared out among them [1]")
    launcher: CommandLine | None = option(
        None,
        "command that starts the ranks; if null, srun --mpi=pmix in a job of SLURM that has srun "
        "and mpiexec elsewhere",
    )
    cores: Annotated[int, Ge(1), Le(65_536)] | None = option(
        None,
        "cores of every solver run; if null a quarter of those that Snakemake may use, and all "
        "for those that are timed [1]",
    )


@parameters
class TolerancesSection:
    """Largest values that pass; those of the solver follow from solver.tolerance if null."""

    truth_residual: Residual | None = option(
        None,
        "residual in energy of any mode of the ground truth; what solver.tolerance allows if null"
        " [1]",
    )
    residual: Residual | None = option(
        None,
        "residual in energy of any mode of HCMS + EC; what solver.tolerance allows if null [1]",
    )
    orthogonality: Residual | None = option(
        None,
        "largest entry of |X^T M X - I| of the ground truth and of HCMS + EC; what the solver "
        "demands if null [1]",
    )
    eigenvalue_error: RelativeError | None = option(
        None,
        "relative error of any eigenvalue of HCMS + EC on the fine mesh; ten times "
        "solver.tolerance and rounding if null [1]",
    )
    subspace_angle: Annotated[float, Gt(0), Le(1.6)] | None = option(
        None,
        "mass-weighted angle between the ground truth and HCMS + EC in any cluster of modes; what"
        " solver.tolerance allows if null [rad]",
    )
    response: RelativeError | None = option(
        None,
        "relative 2-norm of the error of HCMS + EC in the motion after a strike; what "
        "solver.tolerance allows if null [1]",
    )
    frequency_rms: RelativeError = option(
        0.05, "root mean square error of the coarsened solid's frequencies, modes 7 to 60 [1]"
    )
    frequency_worst: RelativeError = option(
        0.15,
        "error of any of these frequencies, three times the other as a coarse model is refined to"
        " [1]",
    )
    solid_rms: RelativeError | None = option(
        None,
        "expected root mean square distance of the frequencies of HCMS + EC from the solid's own,"
        " up to mode 60; told but not judged if null [1]",
    )
    solid_worst: RelativeError | None = option(
        None, "expected distance of any of these frequencies; likewise [1]"
    )


@parameters
class ValidationSection:
    """The page of every model that sets its spectra beside ground truth and judges them."""

    tolerances: TolerancesSection = option(TolerancesSection)
    mass_damping: Annotated[float, Ge(0), Le(1e6)] = option(
        30.0,
        "coefficient of the mass in Rayleigh damping, that of a plastic unless said here (Wang "
        "and James 2019, KleinPAT, table 4) [1/s]",
    )
    stiffness_damping: Annotated[float, Ge(0), Le(1.0)] = option(
        1e-6, "coefficient of the stiffness in Rayleigh damping, of the same plastic [s]"
    )
    contact: Annotated[float, Gt(0), Le(1.0)] = option(
        2e-4,
        "duration of the force that strikes the solid in the sound, half a sine; that of a hard "
        "mallet unless said here [s]",
    )
    periods: Annotated[float, Gt(0), Le(1000)] = option(
        6.0,
        "time after the strike in which motions are compared, in periods of the first elastic "
        "mode [1]",
    )


@parameters
class MeasuredSection:
    """A section that names models of the run."""

    models: Names = option((), "names of the models that this is measured on")

    def check_in(self, run: Configuration) -> None:
        """Check that its models are models of the run."""
        require_named("models", self.models, run.models)


@parameters
class ConvergenceSection(MeasuredSection):
    """How the eigenvalues approach the truth, correction by correction (Fig. 10)."""

    modes: ModelModes = option(256, "modes followed, rigid ones included [1]")
    steps: Annotated[MadeCorrections, Le(10)] = option(3, "corrections made [1]")


@parameters
class TimesSection(MeasuredSection):
    """Methods timed in alternating runs (Fig. 11), in the report of the run."""

    all_methods: Names | None = option(
        None,
        "those of the models that every method is timed on; on the others SLEPc, the solver on "
        "the fine mesh, and what a design does on the coarse one; all if null",
    )
    resolution: Resolution | None = option(
        None, "voxels along the longest side in these runs; a share of the model's own if null [1]"
    )
    share: Share = option(0.75, "that share, where resolution is null [1]")
    modes: ModelModes = option(100, "modes computed, rigid ones included [1]")
    runs: Runs = option(3, "rounds in which every method runs once [1]")
    slow_runs: Runs = option(
        1,
        "rounds that ARPACK takes part in, and all methods on the fine mesh where not every "
        "method is timed [1]",
    )
    tune: bool = option(False, "whether SLEPc runs in the fastest of several configurations")

    def check_in(self, run: Configuration) -> None:
        """Check that its models are models of the run."""
        super().check_in(run)
        require_named("all_methods", self.all_methods or (), self.models)


@parameters
class ScalingSection(MeasuredSection):
    """Wall time over MPI ranks of one core each, measured and modelled, in the run's report."""

    resolution: Resolution | None = option(
        24, "voxels along the longest side in these runs; the model's own if null [1]"
    )
    modes: ModelModes = option(128, "modes computed, rigid ones included [1]")
    ranks: RankCounts = option((1, 2), "numbers of ranks that the scaling is measured on [1]")


@parameters
class Configuration:
    """One file describes a run; all keys but `models` have the defaults written here."""

    _: KW_ONLY
    title: Title = option("Spectra of heterogeneous solids", "heading of the report")
    results_dir: ResultsFolder = option(
        "results", "folder that the run writes to, relative to the working directory"
    )
    mesh_folder: Folder = option(
        "meshes", "folder that mesh and material files are named relative to"
    )
    baseline: File | None = option(
        None, "folder of results that target compare sets this run beside; no result depends on it"
    )
    poisson: PoissonRatio = option(
        0.25, "Poisson's ratio of all materials and of the training blocks [1]"
    )
    models: Solids[ModelEntry] = option(
        REQUIRED, "the solids, by name; a name consists of lower-case letters, digits and hyphens"
    )
    dataset: DatasetSection = option(DatasetSection)
    forests: ForestsSection = option(ForestsSection)
    solver: SolverSection = option(SolverSection)
    validation: ValidationSection = option(ValidationSection)
    convergence: ConvergenceSection = option(ConvergenceSection)
    times: TimesSection = option(TimesSection)
    scaling: ScalingSection = option(ScalingSection)
    default_forest: DefaultForestSection = option(DefaultForestSection)
    resources: dict[str, LimitsSection] = option(
        dict,
        "memory and time that a job of a rule may take, in place of the rule's own; a job that ran "
        "out of them gets twice as much with every try. No result depends on them. Rules that run "
        "where Snakemake does take the default-resources of the profile",
    )
