"""glTF: constants of a design's solid as an acoustic material of KHR_audio_rigid_bodies."""

from typing import Any

from sound.project.design import Design


def acoustic_material(design: Design) -> dict[str, Any]:
    """Constants of the solid, without alpha and beta, as every mode has its own damping."""
    regions = design.model.regions
    poisson = regions.mean_poisson if regions.poisson is None else regions.poisson
    several = {} if design.fine_region is None else {"regions": _regions(design)}
    if not several and not regions.is_isotropic:
        several["regions"] = _regions(design)
    return {
        "name": "designed",
        "density": design.model.density,
        "youngsModulus": float(design.young.mean()),
        "poissonRatio": poisson,
        "extras": {
            "youngsModulus": "mean over the volume; it varies between "
            f"{design.young.min():.6g} and {design.young.max():.6g} Pa",
            **several,
        },
    }


def _regions(design: Design) -> list[dict[str, Any]]:
    """Materials of the regions, wood of several directions a row for each."""
    table, rows = design.model.regions, design.fine_region
    found = []
    for row, name in enumerate(table.names):
        young = design.young if rows is None else design.young[rows == row]
        law = table.laws[row]
        own: dict[str, Any] = {"name": name, "density": float(table.density[row])}
        if len(young):
            own |= {
                "youngsModulus": float(young.mean()),
                "youngsModulusRange": [float(young.min()), float(young.max())],
            }
        if law.poisson is not None:
            own["poissonRatio"] = law.poisson
        else:
            own["elasticity"] = law.matrix.tolist()
        damping = table.damping[row]
        if damping is not None:
            own |= {"alpha": damping[0], "beta": damping[1]}
        found.append(own)
    return found
