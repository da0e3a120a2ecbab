"""One scene, heard by the truth's modes and by coarse ones, and its page (the paper's Fig. 13)."""

NEEDS = ("sounds",)

PAGES = {
    "scene_spectra": "one scene by the truth's modes and by coarse ones (Fig. 13)",
}
