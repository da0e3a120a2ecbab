"""Gives Python for Windows what Wine 8 lacks of the C runtime, and its own `python3.dll`.

Wine exports functions of complex numbers and of the floating-point environment that end the
program. Libraries are told to look for those two parts of the runtime under other names, and what
these export is here, or forwarded to Wine's.

    python fill_gaps.py FOLDER    (of python.exe; needs pefile and x86_64-w64-mingw32-gcc)
"""

import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pefile

COMPLEX = (
    "abs acos acosh arg asin asinh atan atanh cos cosh exp imag log pow real sin sinh sqrt tan tanh"
).split()
REAL_RESULT = ("abs", "arg", "imag", "real")
KINDS = {"": ("double", ""), "l": ("double", ""), "f": ("float", "f")}
"""C's type and ending of a function by the ending of its name: long double is double there."""
BEGIN = """#include <complex.h>
#define KIND(name, real, end) typedef struct { real r, i; } name; \\
    static real complex to_##name(name a) { \\
        real complex z; __real__ z = a.r; __imag__ z = a.i; return z; } \\
    static name from_##name(real complex z) { name a = {creal##end(z), cimag##end(z)}; return a; }
KIND(kind_double, double, )
KIND(kind_float, float, f)
kind_float own__FCbuild(float a, float b) { kind_float z = {a, b}; return z; }
kind_double own__Cbuild(double a, double b) { kind_double z = {a, b}; return z; }
kind_double own__LCbuild(double a, double b) { kind_double z = {a, b}; return z; }
"""
ENVIRONMENT = """
int own_feholdexcept(unsigned long *e) { e[0] = e[1] = 0; return 0; }
int own_feupdateenv(const unsigned long *e) { return 0; }
"""
RANDOM = """#include <windows.h>
#include <ntsecapi.h>
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T count) {
    return RtlGenRandom(bytes, (ULONG)count); }
"""


def main(folder: Path) -> None:
    """Write the libraries beside python.exe and have all others use them."""
    libraries = [each for end in ("pyd", "dll") for each in folder.rglob(f"*.{end}")]
    needed = _needed(libraries)
    for part, source in (("math", _complex_functions()), ("runtime", ENVIRONMENT)):
        own = set(re.findall(r"own_(\w+)", source))
        names = needed[f"api-ms-win-crt-{part}-l1-1-0.dll"]
        exports = [f"{each} = own_{each}" for each in sorted(own)]
        exports += [f"{each} = ucrtbase.{each}" for each in sorted(names - own)]
        _build(folder / f"own-ms-win-crt-{part}-l1-1-0.dll", source, exports)
    python = f"python{''.join(map(str, (3, _minor(folder))))}"
    _build(folder / "python3.dll", "int x;", [f"{x} = {python}.{x}" for x in needed["python3.dll"]])
    _build(folder / "bcryptprimitives.dll", RANDOM, None)
    pattern = re.compile(rb"api(-ms-win-crt-(?:math|runtime)-l1-1-0\.dll)", re.IGNORECASE)
    for each in libraries:
        content = each.read_bytes()
        each.write_bytes(pattern.sub(rb"own\1", content))


def _needed(libraries: list[Path]) -> dict[str, set[str]]:
    """Names that libraries take from others, by the others' names in lower case."""
    names: dict[str, set[str]] = defaultdict(set)
    for each in libraries:
        try:
            image = pefile.PE(str(each), fast_load=True)
        except pefile.PEFormatError:
            continue
        image.parse_data_directories([pefile.DIRECTORY_ENTRY["IMAGE_DIRECTORY_ENTRY_IMPORT"]])
        for entry in getattr(image, "DIRECTORY_ENTRY_IMPORT", []):
            names[entry.dll.decode().lower()] |= {x.name.decode() for x in entry.imports if x.name}
    return names


def _complex_functions() -> str:
    lines = [BEGIN]
    for end, (real, c_end) in KINDS.items():
        kind = f"kind_{real}"
        for name in COMPLEX:
            more = f", {kind} b" if name == "pow" else ""
            value = f"c{name}{c_end}(to_{kind}(a){f', to_{kind}(b)' if more else ''})"
            if name in REAL_RESULT:
                lines.append(f"{real} own_c{name}{end}({kind} a) {{ return {value}; }}")
            else:
                lines.append(
                    f"{kind} own_c{name}{end}({kind} a{more}) {{ return from_{kind}({value}); }}"
                )
    return "\n".join(lines)


def _minor(folder: Path) -> int:
    (library,) = (each for each in folder.glob("python3*.dll") if each.stem != "python3")
    return int(library.stem.removeprefix("python3"))


def _build(library: Path, source: str, exports: list[str] | None) -> None:
    code = library.with_suffix(".c")
    code.write_text(source)
    words = ["x86_64-w64-mingw32-gcc", "-O2", "-fno-builtin", "-w", "-shared", "-static"]
    words += ["-o", str(library), str(code)]
    if exports is not None:
        table = library.with_suffix(".def")
        table.write_text("\n".join([f"LIBRARY {library.name}", "EXPORTS", *exports, ""]))
        words.append(str(table))
    subprocess.run([*words, "-ladvapi32"], check=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
