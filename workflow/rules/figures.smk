# The paper's Fig. 10 and 11 and the scaling over ranks, in full: `snakemake figures`, no part of the
# default run.


rule figures:
    input:
        f"{FIGURES}/report.html",


# The rules below take all cores, although some use one, since they time what they do. The forests
# are those of the package.
use rule time_methods as time_methods_in_full with:
    input:
        model=shape_mesh,
        forests=settings.default_forest_files(),
    output:
        f"{FIGURES}/models/{{shape}}/methods.json",
    log:
        f"{LOGS}/{FIGURES_FOLDER}/{{shape}}/methods.log",
    benchmark:
        f"{BENCHMARKS}/{FIGURES_FOLDER}/{{shape}}/methods.tsv"
    params:
        source=source("solver.commands.benchmark"),
        ranks=RANKS,
        on_ranks=on_ranks(RANKS),
        model=shape_arguments,
        how=times_arguments(config["figures"]),
        forest=forest_argument,


rule follow_convergence_in_full:
    input:
        shape_mesh,
    output:
        f"{FIGURES}/models/{{shape}}/convergence.json",
    log:
        f"{LOGS}/{FIGURES_FOLDER}/{{shape}}/convergence.log",
    benchmark:
        f"{BENCHMARKS}/{FIGURES_FOLDER}/{{shape}}/convergence.tsv"
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(16000),
        runtime=growing(120),
    params:
        source=source("solver.commands.convergence"),
        shape=shape_arguments,
        modes=config["figures"]["modes"],
        steps=config["figures"]["steps"],
    shell:
        "OMP_NUM_THREADS={threads} python -m solver convergence {params.shape:q}"
        " --modes {params.modes:q} --steps {params.steps:q} --out {output:q} > {log:q} 2>&1"


# It starts the ranks itself, one thread each.
rule measure_scaling:
    input:
        shape_mesh,
    output:
        f"{FIGURES}/models/{{shape}}/scaling.json",
    log:
        f"{LOGS}/{FIGURES_FOLDER}/{{shape}}/scaling.log",
    benchmark:
        f"{BENCHMARKS}/{FIGURES_FOLDER}/{{shape}}/scaling.tsv"
    threads: SOLVER_CORES
    resources:
        mem_mb=growing(16000),
        runtime=growing(120),
    params:
        source=source("solver.commands.scaling"),
        shape=shape_arguments,
        modes=config["figures"]["modes"],
        ranks=",".join(map(str, config["figures"]["ranks"])),
        weak=options({"weak": config["figures"]["weak"]}),
    shell:
        "python -m solver scaling {params.shape:q} --modes {params.modes:q}"
        " --ranks {params.ranks:q} {params.weak:q} --out {output:q} > {log:q} 2>&1"


rule tabulate_figures:
    input:
        config=f"{RESULTS}/config.yaml",
        methods=shape_results("methods"),
        convergence=shape_results("convergence", "convergence"),
        scaling=shape_results("scaling", "scaling"),
    output:
        marks.tables(f"{FIGURES}/tables", FIGURE_TABLES, "figures"),
    log:
        f"{LOGS}/{FIGURES_FOLDER}/tables.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.tabulate_figures"),
    script:
        "../scripts/tabulate_figures.py"


use rule plot_convergence as plot_convergence_in_full with:
    input:
        history=f"{FIGURES}/models/{{shape}}/convergence.json",
    output:
        svg=report(
            f"{FIGURES}/figures/{{shape}}-convergence.svg",
            caption="../report/captions/convergence.rst",
            category="Figures",
            subcategory="figures",
            labels={"figure": "Convergence of the error correction, {shape}"},
        ),
        png=f"{FIGURES}/figures/{{shape}}-convergence.png",
    log:
        f"{LOGS}/{FIGURES_FOLDER}/{{shape}}/plot-convergence.log",


use rule plot_methods as plot_methods_in_full with:
    input:
        methods=f"{FIGURES}/tables/methods.json",
    output:
        svg=report(
            f"{FIGURES}/figures/times.svg",
            caption="../report/captions/methods.rst",
            category="Figures",
            subcategory="figures",
            labels={"figure": "Wall times in alternating runs"},
        ),
        png=f"{FIGURES}/figures/times.png",
    log:
        f"{LOGS}/{FIGURES_FOLDER}/plot-times.log",


rule plot_scaling:
    input:
        scaling=f"{FIGURES}/models/{{shape}}/scaling.json",
    output:
        svg=report(
            f"{FIGURES}/figures/{{shape}}-scaling.svg",
            caption="../report/captions/scaling.rst",
            category="Figures",
            subcategory="figures",
            labels={"figure": "Scaling over ranks, {shape}"},
        ),
        png=f"{FIGURES}/figures/{{shape}}-scaling.png",
    log:
        f"{LOGS}/{FIGURES_FOLDER}/{{shape}}/plot-scaling.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.plot_scaling"),
    script:
        "../scripts/plot_scaling.py"


rule build_figures_report:
    input:
        config=f"{RESULTS}/config.yaml",
        tables=expand(f"{FIGURES}/tables/{{table}}.json", table=list(FIGURE_TABLES)),
        times=f"{FIGURES}/figures/times.svg",
        convergence=expand(
            f"{FIGURES}/figures/{{shape}}-convergence.svg", shape=present(config, "convergence")
        ),
        scaling=expand(f"{FIGURES}/figures/{{shape}}-scaling.svg", shape=present(config, "scaling")),
        templates=templates("figures"),
    output:
        report(
            f"{FIGURES}/report.html",
            caption="../report/captions/figures.rst",
            category="Report",
            labels={"page": "Times, convergence and scaling in full"},
        ),
    log:
        f"{LOGS}/{FIGURES_FOLDER}/report.log",
    localrule: True
    resources:
        mem_mb=1000,
        runtime="10m",
    params:
        source=source("workflow.scripts.build_figures_report"),
    script:
        "../scripts/build_figures_report.py"
