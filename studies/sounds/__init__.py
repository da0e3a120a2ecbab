"""Examples of sound design, each with a page: `snakemake sounds`."""

NEEDS = ("design", "recordings")

PAGES = {
    "sounds": "examples of sound design",
    "sounds_of_recordings": "sound design from real recordings",
    "sounds_of_clips": "sound design with all defaults from real recordings",
}
