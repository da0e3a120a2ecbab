# Figures, and the page that shows everything.


rule draw_modes:
    input:
        config=f"{RESULTS}/config.yaml",
        modes=expand(f"{RESULTS}/models/{{{{model}}}}/{{variant}}.h5", variant=variants.SHOWN),
    output:
        pictures=[
            report(
                f"{RESULTS}/figures/{{model}}-mode-{variant}.png",
                caption="../report/captions/mode.rst",
                category="Figures",
                subcategory="{model}",
                labels={"figure": f"First elastic mode, {variants.VARIANTS[variant].label}"},
            )
            for variant in variants.SHOWN
        ],
        description=f"{RESULTS}/figures/{{model}}-mode.json",
    log:
        f"{LOGS}/figures/{{model}}-mode.log",
    localrule: True
    resources:
        mem_mb=2000,
        runtime="15m",
    params:
        source=source("workflow.scripts.draw_modes"),
    script:
        "../scripts/draw_modes.py"


rule plot_spectrum:
    input:
        config=f"{RESULTS}/config.yaml",
        frequencies=f"{RESULTS}/tables/frequencies.json",
    output:
        svg=report(
            f"{RESULTS}/figures/{{model}}-spectrum.svg",
            caption="../report/captions/spectrum.rst",
            category="Figures",
            subcategory="{model}",
            labels={"figure": "Spectrum"},
        ),
        png=f"{RESULTS}/figures/{{model}}-spectrum.png",
    log:
        f"{LOGS}/figures/{{model}}-spectrum.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.plot_spectrum"),
    script:
        "../scripts/plot_spectrum.py"


rule plot_convergence:
    input:
        history=f"{RESULTS}/models/{{model}}/convergence.json",
    output:
        svg=report(
            f"{RESULTS}/figures/{{model}}-convergence.svg",
            caption="../report/captions/convergence.rst",
            category="Figures",
            subcategory="{model}",
            labels={"figure": "Convergence of the error correction"},
        ),
        png=f"{RESULTS}/figures/{{model}}-convergence.png",
    log:
        f"{LOGS}/figures/{{model}}-convergence.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.plot_convergence"),
    script:
        "../scripts/plot_convergence.py"


rule plot_times:
    input:
        times=f"{RESULTS}/tables/times.json",
    output:
        svg=report(
            f"{RESULTS}/figures/times.svg",
            caption="../report/captions/times.rst",
            category="Figures",
            subcategory="all models",
            labels={"figure": "Wall times of one cold run"},
        ),
        png=f"{RESULTS}/figures/times.png",
    log:
        f"{LOGS}/figures/times.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.plot_times"),
    script:
        "../scripts/plot_times.py"


rule plot_methods:
    input:
        methods=f"{RESULTS}/tables/methods.json",
    output:
        svg=report(
            f"{RESULTS}/figures/methods.svg",
            caption="../report/captions/methods.rst",
            category="Figures",
            subcategory="all models",
            labels={"figure": "Wall times in alternating runs"},
        ),
        png=f"{RESULTS}/figures/methods.png",
    log:
        f"{LOGS}/figures/methods.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.plot_methods"),
    script:
        "../scripts/plot_methods.py"


# A picture for a README or a slide: one mode and the spectrum against the truth.
rule draw_overview:
    input:
        modes=f"{RESULTS}/models/{{model}}/ddfem_hcms_ec.h5",
        truth=f"{RESULTS}/models/{{model}}/{variants.TRUTH}.h5",
        frequencies=f"{RESULTS}/tables/frequencies.json",
        config=f"{RESULTS}/config.yaml",
    output:
        report(
            f"{RESULTS}/figures/{{model}}-overview.png",
            caption="../report/captions/overview.rst",
            category="Figures",
            subcategory="{model}",
            labels={"figure": "Mode and spectrum"},
        ),
    log:
        f"{LOGS}/figures/{{model}}-overview.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.draw_overview"),
    script:
        "../scripts/draw_overview.py"


rule build_report:
    input:
        config=f"{RESULTS}/config.yaml",
        tables=expand(f"{RESULTS}/tables/{{table}}.json", table=TABLES),
        pictures=expand(
            f"{RESULTS}/figures/{{model}}-mode-{{variant}}.png",
            model=MODELS,
            variant=variants.SHOWN,
        ),
        descriptions=expand(f"{RESULTS}/figures/{{model}}-mode.json", model=MODELS),
        validation=expand(f"{RESULTS}/validation/tables/{{model}}-criteria.json", model=MODELS),
        spectra=expand(f"{RESULTS}/figures/{{model}}-spectrum.svg", model=MODELS),
        convergence=expand(
            f"{RESULTS}/figures/{{model}}-convergence.svg",
            model=config["convergence"]["models"],
        ),
        times=f"{RESULTS}/figures/times.svg",
        methods=[f"{RESULTS}/figures/methods.svg"] if config["times"]["models"] else [],
        scaling=expand(
            f"{RESULTS}/figures/{{model}}-scaling.svg", model=config["scaling"]["models"]
        ),
        templates=templates("report"),
    output:
        report(
            f"{RESULTS}/report.html",
            caption="../report/captions/report.rst",
            category="Report",
            labels={"page": "This run"},
        ),
    log:
        f"{LOGS}/report.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.build_report"),
    script:
        "../scripts/build_report.py"
