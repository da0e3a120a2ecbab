"""Arrays of moduli and sounds: valid ones, and all else that a file can hold in their place."""

import struct
from pathlib import Path

import numpy as np

RATE = 22_050


def make(folder: Path, voxels: int) -> None:
    """Write moduli for so many `voxels`, and clips."""
    _make_moduli(folder, voxels)
    _make_liars(folder, voxels)
    _make_clips(folder)


def _make_moduli(folder: Path, voxels: int) -> None:
    good = np.linspace(1e9, 2e9, voxels)
    first = np.arange(voxels) == 0
    arrays = {
        "good": good,
        "whole": good.astype(np.int64),
        "single": good.astype(np.float32),
        "swapped": good.astype(">f8"),
        "complex": good * (1 + 0.5j),
        "bool": np.ones(voxels, bool),
        "datetime": np.full(voxels, "2020-01-01", "datetime64[s]"),
        "duration": np.full(voxels, 10**9, "timedelta64[s]"),
        "text": np.full(voxels, "1e9"),
        "bytes": np.full(voxels, b"1e9"),
        "structured": np.zeros(voxels, [("young", float), ("density", float)]),
        "short": good[:-1],
        "long": np.append(good, 1e9),
        "none": good[:0],
        "scalar": np.array(1e9),
        "negative": np.where(first, -1e9, good),
        "nan": np.where(first, np.nan, good),
        "inf": np.where(first, np.inf, good),
        "zero": np.where(first, 0.0, good),
        "zeros": 0.0 * good,
        "huge": np.full(voxels, 1e300),
        "tiny": np.full(voxels, 1e-300),
        "contrast": np.where(first, 1e-200, 1e200),
        "denormal": np.full(voxels, 5e-324),
    }
    for name, array in arrays.items():
        np.save(folder / f"{name}.npy", array)
    np.save(folder / "object.npy", np.array([_Trap()] * voxels, dtype=object), allow_pickle=True)
    np.savez(folder / "archive.npz", young=good)
    (folder / "archive.npy").write_bytes((folder / "archive.npz").read_bytes())
    np.savetxt(folder / "good.txt", good)
    texts = {
        "words": "one\n" * voxels,
        "complex": "(1e9+1e8j)\n" * voxels,
        "true": "True\n" * voxels,
        "short": "1e9\n" * (voxels - 1),
        "ragged": "1e9 1e9\n1e9\n",
        "nan": "nan\n" * voxels,
        "empty": "",
        "comments": "# nothing\n",
        "semicolons": ";".join(["1e9"] * voxels),
        "commas": "1,5e9\n" * voxels,
        "digits": "１e9\n" * voxels,
        "underscores": "1_000\n" * voxels,
        "hexadecimal": "0x10\n" * voxels,
        "beyond": "1e999\n" * voxels,
    }
    for name, text in texts.items():
        (folder / f"{name}.txt").write_text(text, encoding="utf-8")
    (folder / "latin.txt").write_bytes("Elastizität\n".encode("latin-1") * voxels)
    (folder / "nul.txt").write_bytes(b"1e9\0\n" * voxels)


class _Trap:
    """Loading its pickle leaves a file."""

    def __reduce__(self) -> tuple[object, tuple[str, str]]:
        return (open, ("trapped", "w"))


def _make_liars(folder: Path, voxels: int) -> None:
    content = (folder / "good.npy").read_bytes()
    (folder / "cut.npy").write_bytes(content[:-20])
    (folder / "head.npy").write_bytes(content[:40])
    (folder / "empty.npy").touch()
    (folder / "junk.npy").write_bytes(np.random.default_rng(1).bytes(1000))
    (folder / "version.npy").write_bytes(content[:6] + b"\x09\x09" + content[8:])
    shapes = {"claims": "(100000000000000,)", "square": "(9000000000, 9000000000)"}
    shapes |= {"below": "(-24,)", "code": "(__import__('os').getpid(),)"}
    for name, shape in shapes.items():
        head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
        head += b" " * (-(len(head) + 11) % 64) + b"\n"
        start = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head))
        (folder / f"{name}.npy").write_bytes(start + head + bytes(8 * voxels))


def _make_clips(folder: Path) -> None:
    import soundfile

    seconds = np.arange(int(0.3 * RATE)) / RATE
    tone = 0.5 * np.exp(-20 * seconds) * np.sin(2 * np.pi * 800 * seconds)
    random = np.random.default_rng(2)
    sounds = {
        "silence": 0.0 * tone,
        "none": tone[:0],
        "one": tone[:1],
        "brief": tone[:20],
        "constant": 0.0 * tone + 0.25,
        "clipped": np.clip(20 * tone, -1, 1),
        "opposed": np.stack([tone, -tone], axis=1),
    }
    for name, samples in sounds.items():
        soundfile.write(folder / f"{name}.wav", samples, RATE, "PCM_16")
    for name, value in (("nan", np.nan), ("inf", np.inf), ("huge", 1e300), ("large", 1e30)):
        samples = tone.copy()
        samples[100] = value
        soundfile.write(folder / f"{name}.wav", samples, RATE, "DOUBLE")
    soundfile.write(folder / "all-huge.wav", tone * 1e300, RATE, "DOUBLE")
    soundfile.write(folder / "tiny.wav", tone * 1e-300, RATE, "DOUBLE")
    soundfile.write(folder / "noise.wav", 0.1 * random.standard_normal(2000), RATE, "PCM_16")
    soundfile.write(folder / "24-bit.wav", tone, RATE, "PCM_24")
    soundfile.write(folder / "tone.wav", tone, RATE, "FLOAT")
    soundfile.write(folder / "tone.flac", tone, RATE)
    soundfile.write(folder / "slow.wav", tone, 1)
    whole = (folder / "24-bit.wav").read_bytes()
    (folder / "cut-24-bit.wav").write_bytes(whole[:-1001])
    (folder / "head.wav").write_bytes(whole[:30])
    (folder / "empty.wav").touch()
    (folder / "junk.wav").write_bytes(random.bytes(3000))
    (folder / "riff.wav").write_bytes(b"RIFF\xff\xff\xff\xffWAVE" + random.bytes(3000))
    (folder / "text.wav").write_text("this is no sound\n")
    _lie(folder / "rate-zero.wav", rate=0)
    _lie(folder / "rate-huge.wav", rate=2**32 - 1)
    _lie(folder / "no-channels.wav", channels=0)
    _lie(folder / "many-channels.wav", channels=65_535)
    _lie(folder / "claims.wav", size=2**32 - 9)


def _lie(path: Path, rate: int = RATE, channels: int = 1, size: int = 2000) -> None:
    """A WAV file of 16 bits a sample whose head says so."""
    block = 2 * channels % 65_536
    form = struct.pack("<HHIIHH", 1, channels, rate, rate * block % 2**32, block, 16)
    data = np.random.default_rng(3).bytes(2000)
    head = b"RIFF" + struct.pack("<I", 2**32 - 1) + b"WAVEfmt " + struct.pack("<I", 16) + form
    path.write_bytes(head + b"data" + struct.pack("<I", size) + data)
