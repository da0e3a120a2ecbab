# A page for every model that judges its spectra: `snakemake validation`, part of the default run too.
from workflow.validation import study as validation_study

VALIDATION = f"{RESULTS}/validation"


rule validation:
    input:
        expand(f"{VALIDATION}/{{model}}.html", model=MODELS),


rule audit_spectra:
    input:
        model_results(variants.shown_of, "models/{model}/{variant}.h5"),
    output:
        f"{RESULTS}/models/{{model}}/audit.json",
    log:
        f"{LOGS}/models/{{model}}/audit.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/audit.tsv"
    resources:
        **limits("audit_spectra"),
    params:
        source=source("solver.commands.audit"),
        tolerance=options({"tolerance": config["solver"]["tolerance"]}),
    shell:
        "python -m solver audit {input:q} {params.tolerance:q} --out {output:q} > {log:q} 2>&1"


rule strike_solid:
    input:
        model_results(variants.shown_of, "models/{model}/{variant}.h5"),
    output:
        f"{RESULTS}/models/{{model}}/response.h5",
    log:
        f"{LOGS}/models/{{model}}/response.log",
    benchmark:
        f"{BENCHMARKS}/models/{{model}}/response.tsv"
    resources:
        **limits("strike_solid"),
    params:
        source=source("solver.commands.respond"),
        strike=strike_arguments,
    shell:
        "python -m solver respond {input:q} {params.strike:q} --out {output:q} > {log:q} 2>&1"


rule validate_model:
    input:
        model=model_files,
        config=f"{RESULTS}/config.yaml",
        modes=model_results(variants.shown_of, "models/{model}/{variant}.h5"),
        comparisons=f"{RESULTS}/models/{{model}}/comparisons.json",
        audit=f"{RESULTS}/models/{{model}}/audit.json",
        response=f"{RESULTS}/models/{{model}}/response.h5",
        pictures=model_results(variants.shown_of, "figures/{model}-mode-{variant}.png"),
        description=f"{RESULTS}/figures/{{model}}-mode.json",
    output:
        f"{VALIDATION}/{{model}}.html",
        criteria=f"{VALIDATION}/tables/{{model}}-criteria.json",
        solid=f"{VALIDATION}/tables/{{model}}-solid.json",
    log:
        f"{LOGS}/validation/{{model}}.log",
    localrule: True
    params:
        **made_with_tables(validation_study.VALIDATION),
    script:
        "../../studies/base/scripts/page.py"
