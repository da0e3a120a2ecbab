"""Write the channel of a real recording that is searched as the clip of a target."""

from sound.clips.wav import read_wav, write_wav
from studies.base.study import logged

with logged(snakemake.log):
    samples, rate = read_wav(snakemake.params.recording)
    write_wav(snakemake.output[0], samples, rate)
