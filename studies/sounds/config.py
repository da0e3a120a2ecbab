"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated

from annotated_types import Ge, Le

from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import Resolution, Seed
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import File, Runs, Seconds, Several

EXAMPLES = (
    *("frying-pan", "recorded-pan", "recorded-bar", "recorded-bell", "recorded-pitcher"),
    *("chord", "pitcher"),
)
"""Examples without clips of real strikes."""
RECORDED = ("wood-block", "standing-bell", "tabla", "glass")
"""Examples with such clips."""
PAIRS = (
    *("wood-block-hard-on-bar", "wood-block-hard-on-bowl"),
    *("clave-hard-on-bar", "clave-hard-on-frying-pan"),
    *("small-bell-on-bowl", "small-bell-on-bar"),
    *("cowbell-on-frying-pan", "cowbell-on-bowl"),
    *("glass-high-on-bowl", "glass-high-on-frying-pan"),
    *("agogo-high-on-frying-pan", "agogo-high-on-bar"),
)
"""Pairs of a recording and a built-in solid."""


@parameters
class SoundSection:
    """The examples of sound design, each with a page; target sounds computes them."""

    examples: Several[Annotated[str, OneOf(*EXAMPLES)]] = option(
        EXAMPLES,
        "names of the examples; the pan with a metal and a wooden clip (Fig. 14), the same with "
        "clips of a fine model, a bar, a bell and a pitcher with such clips, four piano tones on "
        "one body (Fig. 15), a pitcher that is edited twice",
    )
    recordings: Several[Annotated[str, OneOf(*RECORDED)]] = option(
        RECORDED,
        "names of the examples whose clips are real recordings; target sounds_of_recordings "
        "computes them",
    )
    clips: Several[Annotated[str, OneOf(*PAIRS)]] = option(
        PAIRS,
        "pairs of a recording and a solid that are designed with all defaults, RECORDING-on-SOLID; "
        "target sounds_of_clips computes them",
    )
    clip_evaluations: Annotated[int, Ge(1), Le(1_000_000_000)] | None = option(
        None,
        "modal analyses of the search for the material of a pair, in place of the default "
        "processor time of a design, which holds if null [1]",
    )
    seeded_clip: Annotated[str, OneOf(*PAIRS)] = option(
        "glass-high-on-bowl", "the pair that is designed by several seeds"
    )
    clip_seeds: Runs = option(5, "seeds of that pair [1]")
    bunny: File = option(
        "stanford-bunny.obj",
        "mesh file of the Stanford bunny below mesh_folder, for the chord; a built-in bell takes "
        "its place where there is none",
    )
    resolution: Resolution | None = option(
        None, "voxels along the longest side of the bounding box; each example's own if null [1]"
    )
    modes: Annotated[int, Ge(2), Le(10_000)] | None = option(
        None, "elastic modes that are controlled; each example's own if null [1]"
    )
    seconds: Seconds | None = option(
        None,
        "processor time of the search for a material, in every edit of an example; each example's "
        "own if null [s]",
    )
    compare_seconds: Seconds = option(
        60.0, "processor time of every optimiser where they are compared, on the frying pans [s]"
    )
    compare_seeds: Runs = option(
        5,
        "seeds of every optimiser in the comparison on the recorded solids, snakemake "
        "compared_sounds [1]",
    )
    reach_seconds: Seconds = option(
        300.0,
        "wall time of the question which modes a solid can have, where a design took off less than "
        "nine tenths of its cost [s]",
    )
    seed: Seed = option(0, "seed of the search")


SECTIONS = {"sound": SoundSection}
LIMITS = {
    "synthesise_clip": JobLimits("a clip without a model", 1000, 10),
    "record_clip": JobLimits("a clip of a fine model", 1000, 10),
    "check_design": JobLimits(
        "modes of the fine model of a sound, or of a recorded solid", 8000, 60
    ),
    "init_project": JobLimits("a project with all defaults", 1000, 10),
    "begin_design": JobLimits("where a search for a material starts", 8000, 30),
    "design_sound": JobLimits("a search for a material", 8000, 60),
    "compare_optimisers": JobLimits("optimisers beside each other", 8000, 60),
    "find_reach": JobLimits("which modes a solid can have", 8000, 60),
    "render_before": JobLimits("a sound before or after a design", 1000, 10),
    "render_fine": JobLimits("a sound of the fine model", 2000, 10),
}
