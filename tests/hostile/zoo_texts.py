"""YAML and JSON: projects and configurations that are broken, hostile or no such thing."""

from pathlib import Path

BOMB = "\n".join(
    [
        "a0: &a0 [x, x, x, x, x, x, x, x, x]",
        *(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 9)),
    ]
)
"""References that stand for 9^9 items."""


def make(folder: Path, project: str, configuration: str) -> None:
    """Write each kind of bad YAML as it is, and behind a valid project and configuration."""
    for name, content in hostile_yaml().items():
        (folder / f"{name}.yaml").write_bytes(content)
    for kind, text in (("project", project), ("config", configuration)):
        whole = text.encode()
        behind = {
            "twice": whole + whole.splitlines(keepends=True)[0],
            "bomb": whole + BOMB.encode(),
            "nested": whole + b"title: " + b"[" * 5000 + b"]" * 5000,
            "long": whole + b"# " + b"x" * (2 << 20),
            "nul": whole + b"title: \0\n",
            "latin": whole + "title: Körper\n".encode("latin-1"),
            "tag": whole + b"title: !!python/object/apply:os.system ['touch x']\n",
            "second": whole + b"---\n" + whole,
            "cut": whole[:-3] if kind == "config" else whole[: len(whole) // 2],
        }
        for name, content in behind.items():
            (folder / f"{kind}-{name}.yaml").write_bytes(content)
        (folder / f"{kind}-marked.yaml").write_bytes(b"\xef\xbb\xbf" + whole)
    for name, text in {
        "not": "{",
        "list": "[1, 2]",
        "empty": "",
        "number": "1e400",
        "wrong": '{"made": 1}',
        "deep": "[" * 100_000,
    }.items():
        (folder / f"{name}.json").write_text(text)


def hostile_yaml() -> dict[str, bytes]:
    """YAML that is no description of anything, by name."""
    return {
        "empty": b"",
        "comment": b"# nothing\n",
        "list": b"- mesh\n- targets\n",
        "scalar": b"builtin:bar\n",
        "number": b"1e9\n",
        "null": b"null\n",
        "bomb": BOMB.encode(),
        "self": b"&a [*a]\n",
        "merge": b"a: &a {b: 1}\nc: {<<: *a}\n",
        "nested": b"[" * 5000 + b"]" * 5000,
        "mappings": b"{a: " * 5000 + b"}" * 5000,
        "indented": b"".join(b" " * n + b"a:\n" for n in range(2000)),
        "tag": b"!!python/object/apply:os.system ['touch x']\n",
        "tab": b"mesh:\n\t- a\n",
        "colon": b"mesh: builtin: bar\n",
        "unclosed": b'mesh: "builtin\n',
        "junk": bytes(range(128, 256)) * 8,
        "zeros": bytes(4096),
        "utf16": "mesh: builtin:bar\n".encode("utf-16"),
        "escape": b"mesh: \x1b[2J\n",
        "keys": b"? [a, b]\n: 1\n",
        "one-line": b"mesh: " + b"x" * (2 << 20),
        "binary": b"mesh: !!binary AAAA\n",
        "set": b"!!set {mesh, targets}\n",
    }
