# Examples of sound design: their files, and arguments of the programs.
from dataclasses import asdict

from studies.sounds import examples as sound_examples
from studies.sounds.examples import COMPARISON, DESIGN, ELSEWHERE, PROJECT
from studies.sounds.examples import REACHED, START, TRUTH

SOUND_FOLDER = sound_examples.FOLDER
SOUND = f"{RESULTS}/{SOUND_FOLDER}"
EXAMPLES = sound_examples.examples(config)

RECORDED = [name for name in EXAMPLES if EXAMPLES[name].recorded]
DESCRIBED = [name for name in EXAMPLES if not EXAMPLES[name].by_default]
BY_DEFAULT = [name for name in EXAMPLES if EXAMPLES[name].by_default]
OF_RECORDINGS = [*config["sound"][sound_examples.OF_RECORDINGS], *BY_DEFAULT]
WITHOUT_RECORDINGS = config["sound"][sound_examples.WITHOUT_RECORDINGS]
SYNTHESISED = [name for name in WITHOUT_RECORDINGS if not EXAMPLES[name].recorded]


wildcard_constraints:
    example="|".join(EXAMPLES),
    part="|".join(part for example in EXAMPLES.values() for part in example.parts),
    point=r"[a-z][a-z0-9-]*",


def only(names):
    """Pattern of the names of some examples, or of none."""
    return "|".join(names) or "-"


def example_of(wildcards):
    """The example that a part belongs to."""
    return EXAMPLES[wildcards.part.split("/")[0]]


def targets_of(wildcards):
    """Targets of an example by name."""
    return {target.name: target for target in EXAMPLES[wildcards.example].targets}


def part_clips(wildcards):
    """Clips of the targets of a part."""
    example = example_of(wildcards)
    targets = example.targets_of(wildcards.part)
    return [f"{SOUND}/{example.name}/clips/{target.name}.wav" for target in targets]


def design_before(wildcards):
    """The design of the edit before; none for the first."""
    example = example_of(wildcards)
    edit = example.edit_of(wildcards.part)
    return [] if edit == 1 else [f"{SOUND}/{example.part(edit - 1)}/{DESIGN}"]


def clip_file(wildcards):
    """File of the real recording that a target has."""
    recording = targets_of(wildcards)[wildcards.point].recording
    return REAL[recording].path(Path(RECORDINGS, PACKAGES))


def recording_of(wildcards):
    """What a recorded solid is made from."""
    example = EXAMPLES[wildcards.example]
    return {
        "mesh": example.mesh,
        "resolution": example.resolution,
        "recorded": asdict(example.recorded),
    }


def strike_of_recording(wildcards):
    """Where and how a recorded solid is struck for a clip."""
    at = targets_of(wildcards)[wildcards.point].at
    damping = EXAMPLES[wildcards.example].recorded.damping
    return options({"at": at, "damping": damping})


def sound_arguments(wildcards, output):
    """Where an example is struck for a sound, and where its modes alone are written."""
    if wildcards.point == ELSEWHERE:
        place = {"at": EXAMPLES[wildcards.example].elsewhere[1]}
    else:
        place = {"target": wildcards.point}
    return options({**place, "modes_out": output.modes})


def search_options(wildcards, input):
    """Options of a search for a material, and the design that it goes on from."""
    return options({"initial_design": str(input.before), **example_of(wildcards).search})


def all_sounds(wildcards):
    """All sounds of an example's page, and their modes alone, which the clips have not."""
    names = list(targets_of(wildcards))
    rendered = [f"{state}/{{}}{name}.wav" for state in ("before", "fine") for name in names]
    rendered += [f"after/{{}}{name}.wav" for name in [*names, ELSEWHERE]]
    files = [file.format(folder) for file in rendered for folder in ("", "modes/")]
    files += [f"clips/{name}.wav" for name in names]
    return [f"{SOUND}/{wildcards.example}/{file}" for file in files]


def example_clips(wildcards):
    """Clips of all targets of an example."""
    return [f"{SOUND}/{wildcards.example}/clips/{name}.wav" for name in targets_of(wildcards)]


def mesh_files(wildcards):
    """Mesh file of an example; none for a built-in object."""
    return EXAMPLES[wildcards.example].mesh_files


def example_designs(wildcards):
    """Designs of all edits of an example."""
    return [f"{SOUND}/{part}/{DESIGN}" for part in EXAMPLES[wildcards.example].parts]


def comparison(wildcards):
    """The comparison of the optimisers, where there is one."""
    compared = EXAMPLES[wildcards.example].compared
    return [f"{SOUND}/{wildcards.example}/optimisers.json"] if compared else []


def reached(wildcards):
    """Which modes the solid can have; of a pair it is not asked, as that may take minutes."""
    is_pair = EXAMPLES[wildcards.example].by_default
    return [] if is_pair else [f"{SOUND}/{wildcards.example}/{REACHED}"]
