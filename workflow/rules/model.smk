# From a model in the configuration to the solver's arguments.

SOLID_OPTIONS = ("unit", "up", "density", "lumped", "seed", "fill", "components")
HCMS_OPTIONS = ("interface", "retained_modes", "subdomains")
CORRECTION_OPTIONS = ("corrections", "acceleration", "linear_solver", "missed_tolerance")


def model_files(wildcards):
    """Mesh and material files of a model; none for a built-in object."""
    return settings.model_files(config, wildcards.model)


def surface_files(wildcards):
    """Mesh file of a model of finite cells, which is drawn; none for voxels, which are drawn."""
    cells = config["models"][wildcards.model]["discretisation"] != "voxel"
    return settings.model_files(config, wildcards.model) if cells else []


def model_arguments(wildcards, resolution=None):
    """What the solid is: mesh, resolution (the model's own if None), material."""
    model = config["models"][wildcards.model]
    cells = model["discretisation"] != "voxel"
    how = {
        "resolution": resolution or model["resolution"],
        "discretisation": model["discretisation"] if cells else None,
        "wall": model["wall"],
        "wall_side": model["wall_side"] if model["wall"] else None,
        "material": settings.material_of(config, wildcards.model),
        "poisson": config["poisson"],
        "regions": settings.regions_of(config, wildcards.model),
        "fix": model["fix"],
        **{key: model[key] for key in SOLID_OPTIONS},
    }
    return [settings.mesh_of(config, wildcards.model), *options(how)]


def model_results(names, pattern):
    """Results of a model by the variants that `names` tells of it, as input of a rule."""

    def files(wildcards):
        chosen = names(config["models"][wildcards.model])
        return expand(f"{RESULTS}/{pattern}", model=wildcards.model, variant=chosen)

    return files


def compared_files(wildcards):
    """Modes files that are compared with the truth."""
    names = variants.further_of if wildcards.further else variants.judged_of
    return model_results(names, "models/{model}/{variant}.h5")(wildcards)


def variant_files(wildcards):
    """The forests, for the variants that coarsen with them."""
    needs_forests = variants.VARIANTS[wildcards.variant].coarsen == "ddfem"
    return [FORESTS] if needs_forests else []


def forest_argument(wildcards, input):
    """The forests to coarsen with, if any are named."""
    return options({"forest": str(input.forests)})


def variant_arguments(wildcards, input):
    """How the solid is coarsened and solved."""
    variant = variants.VARIANTS[wildcards.variant]
    return [
        *options({"coarsen": variant.coarsen, "method": variant.method}),
        *forest_argument(wildcards, input),
        *distance_arguments(wildcards),
        *(hcms_arguments(variant.corrected) if variant.method == "hcms" else []),
    ]


def distance_arguments(wildcards):
    """Whether the distance from the solid is told, and how fine a coarsened solid is kept.

    Finite cells are those of all variants.
    """
    cells = config["models"][wildcards.model]["discretisation"] != "voxel"
    told = wildcards.variant == variants.FROM_SOLID
    # Finite cells tell it by themselves, at hardly a cost; voxels need a second solve.
    how = {"estimate": told and not cells, "no_estimate": not told}
    by_forests = variants.VARIANTS[wildcards.variant].coarsen == "ddfem"
    fine = config["solver"]["refine_to"] if by_forests else None
    return options(how | {"refine_to": 0 if cells else fine})


def hcms_arguments(corrected):
    """Parameters of component mode synthesis and its correction."""
    solver = config["solver"]
    how = {key: solver[key] for key in HCMS_OPTIONS}
    if not corrected:
        return options(how | {"corrections": 0})
    corrections = {key: solver[key] for key in CORRECTION_OPTIONS}
    return options(how | {"tolerance": solver["tolerance"]} | corrections)


def model_modes(wildcards):
    """Number of modes of a model, rigid ones included."""
    return config["models"][wildcards.model]["modes"] or config["solver"]["modes"]


def strike_arguments(wildcards):
    """How a model is struck in its validation; points in metres."""
    model, how = config["models"][wildcards.model], config["validation"]
    points = {
        name: [f"{model['unit'] * part:.12f}" for part in model[name] or []]
        for name in ("strike", "observed")
    }
    names = ("mass_damping", "stiffness_damping", "contact", "periods")
    return options(points | {name: how[name] for name in names})
