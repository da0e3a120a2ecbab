# From a model in the configuration to the solver's arguments.


def model_files(wildcards):
    """Mesh and material files of a model; none for a built-in object."""
    return settings.model_files(config, wildcards.model)


def model_arguments(wildcards):
    """What the solid is: mesh, resolution, material."""
    model = config["models"][wildcards.model]
    return (
        f"{settings.mesh_of(config, wildcards.model)} --resolution {model['resolution']}"
        f" --material {settings.material_of(config, wildcards.model)} --unit {model['unit']}"
        f" --density {model['density']} --poisson {config['poisson']} --seed {model['seed']}"
        f" --pieces {model['pieces']}"
    )


def variant_files(wildcards):
    """The forests, for the variants that coarsen with them."""
    needs_forests = variants.VARIANTS[wildcards.variant].coarsen == "ddfem"
    return [f"{RESULTS}/forests/forests.h5"] if needs_forests else []


def variant_arguments(wildcards, input):
    """How the solid is coarsened and solved."""
    variant = variants.VARIANTS[wildcards.variant]
    arguments = [f"--coarsen {variant.coarsen} --method {variant.method}"]
    if input.forests:
        arguments.append(f"--forest {input.forests}")
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


def model_modes(wildcards):
    """Number of modes of a model, rigid ones included."""
    return settings.modes_of(config, wildcards.model)
