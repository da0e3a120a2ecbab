# From a model in the configuration to the solver's arguments.


def model_files(wildcards):
    """Mesh and material files of a model; none for a built-in object."""
    return settings.model_files(config, wildcards.model)


def model_arguments(wildcards, resolution=None):
    """What the solid is: mesh, resolution (the model's own if None), material."""
    model = config["models"][wildcards.model]
    return (
        f"{settings.mesh_of(config, wildcards.model)}"
        f" --resolution {resolution or model['resolution']}"
        f" --material {settings.material_of(config, wildcards.model)} --unit {model['unit']}"
        f" --density {model['density']} --poisson {config['poisson']} --seed {model['seed']}"
        f" --fill {model['fill']} --pieces {model['pieces']}"
    )


def variant_files(wildcards):
    """The forests, for the variants that coarsen with them."""
    needs_forests = variants.VARIANTS[wildcards.variant].coarsen == "ddfem"
    return [FORESTS] if needs_forests else []


def forest_argument(wildcards, input):
    """The forests to coarsen with, if any are named."""
    return f"--forest {input.forests}" if input.forests else ""


def variant_arguments(wildcards, input):
    """How the solid is coarsened and solved."""
    variant = variants.VARIANTS[wildcards.variant]
    arguments = [f"--coarsen {variant.coarsen} --method {variant.method}"]
    arguments.append(forest_argument(wildcards, input))
    if variant.method == "hcms":
        arguments.append(hcms_arguments(variant.corrected))
    return " ".join(arguments)


def hcms_arguments(corrected):
    """Parameters of component mode synthesis and its correction."""
    solver = config["solver"]
    arguments = [f"--interface {solver['interface']}"]
    arguments += [f"--{key} {solver[key]}" for key in ("keep", "subdomains") if solver[key]]
    if corrected:
        arguments.append(f"--tol {solver['tolerance']} --corrections {solver['corrections']}")
    else:
        arguments.append("--corrections 0")
    return " ".join(arguments)


def timed_arguments(wildcards):
    """The solid on which all methods are timed."""
    return model_arguments(wildcards, config["times"]["resolution"])


def times_arguments(part):
    """How methods are timed, from a part of the configuration."""
    flags = [f"--{key.replace('_', '-')}" for key in ("tune", "arpack_regular") if part.get(key)]
    numbers = [f"--{key.replace('_', '-')} {part[key]}" for key in ("modes", "runs", "slow_runs")]
    return " ".join([*numbers, *flags])


def model_modes(wildcards):
    """Number of modes of a model, rigid ones included."""
    return settings.modes_of(config, wildcards.model)


def strike_arguments(wildcards):
    """How a model is struck in its validation; points in metres."""
    model, how = config["models"][wildcards.model], config["validation"]
    points = [
        f"--{name} " + " ".join(f"{model['unit'] * part:.12f}" for part in model[name])
        for name in ("strike", "observed")
        if model[name]
    ]
    names = ("mass_damping", "stiffness_damping", "contact", "periods")
    return " ".join([*points, *(f"--{name.replace('_', '-')} {how[name]}" for name in names)])
