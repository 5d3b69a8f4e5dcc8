"""Run the fast tests on other Python versions than that of `.venv`: `make pythons`.

An interpreter is searched by its name on PATH, and in `versions` of pyenv's root. Each gets its own environment in
`build/pythons/VERSION`. A missing version is named and skipped. Exit codes: 0 all tests pass, 1 some fail, 2 no
interpreter was found; those of `tools/setup.py` if an environment cannot be made.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VERSIONS = ("3.12", "3.13")
"""Versions to test."""
SLOW = ("slow", "study", "ray", "model", "faults", "episodes", "thorough", "wheels", "learners")
FAST = "not " + " and not ".join(SLOW)
"""Markers that select the fast tests."""
NONE_FOUND = 2
"""Exit code if no interpreter was found."""


def main(tests: list[str]) -> int:
    """Test every available version. `tests`: arguments of pytest instead of all tests."""
    interpreters = {version: interpreter for version in VERSIONS if (interpreter := find(version)) is not None}
    for version in VERSIONS:
        if version not in interpreters:
            print(f"pythons: no Python {version} on PATH or with pyenv: skipped", file=sys.stderr)
    if not interpreters:
        return NONE_FOUND
    codes = [test(version, interpreter, tests) for version, interpreter in interpreters.items()]
    return max(codes)


def find(version: str) -> Path | None:
    """An interpreter of this version, or None. A pyenv shim without a version behind it does not count."""
    return next((path for path in candidates(version) if version_of(path) == version), None)


def candidates(version: str) -> Iterator[Path]:
    """Yield possible interpreters of this version, the most likely first."""
    name = f"python{version}"
    on_path = shutil.which(name)
    if on_path is not None:
        yield Path(on_path)
    root = pyenv_root()
    if root is not None:
        yield from sorted(root.glob(f"versions/{version}*/bin/{name}"), reverse=True)


def pyenv_root() -> Path | None:
    """The folder of pyenv's interpreters, as pyenv reports it; None without pyenv."""
    named = os.environ.get("PYENV_ROOT")
    if named:
        return Path(named)
    if shutil.which("pyenv") is None:
        return None
    printed = subprocess.run(["pyenv", "root"], capture_output=True, text=True, check=False).stdout.strip()
    return Path(printed) if printed else None


def version_of(interpreter: Path) -> str:
    """The major and minor version that an interpreter reports; "" if it does not run."""
    code = "import sys; print('.'.join(map(str, sys.version_info[:2])))"
    try:
        done = subprocess.run([str(interpreter), "-c", code], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def test(version: str, interpreter: Path, tests: list[str]) -> int:
    """Make the environment of a version and run the tests in it. Return the first exit code that is not 0, else 0."""
    folder = ROOT / "build" / "pythons" / version
    print(f"pythons: {version} is {interpreter}", file=sys.stderr, flush=True)
    made = subprocess.run([str(interpreter), str(ROOT / "tools" / "setup.py"), "--into", str(folder)], check=False)
    if made.returncode != 0:
        return made.returncode
    options = ("-q", "-m", FAST, "-n", "2", "--dist", "loadfile", "--no-loadscope-reorder")
    command = [str(folder / "bin" / "python"), "-m", "pytest", *options, *tests]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
