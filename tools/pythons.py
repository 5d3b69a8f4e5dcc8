"""Run the fast part of the tests on other Pythons than the one of `.venv`: `make pythons`.

An interpreter is found by its name on PATH, or in `versions` of pyenv's root. Each has an environment of its own,
`build/pythons/VERSION`. A version that is not found is named and skipped. Exit codes: 0 the tests of all that were
found pass, 1 some fail, 2 none was found; those of `tools/setup.py` where an environment cannot be made.
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
FAST = "not slow and not study and not ray and not model"
NONE_FOUND = 2


def main(tests: list[str]) -> int:
    """Test on every version that is found; `tests` are arguments for pytest instead of all tests."""
    found = {version: interpreter for version in VERSIONS if (interpreter := find(version)) is not None}
    for version in VERSIONS:
        if version not in found:
            print(f"pythons: no Python {version} on PATH or with pyenv: skipped", file=sys.stderr)
    if not found:
        return NONE_FOUND
    codes = [test(version, interpreter, tests) for version, interpreter in found.items()]
    return max(codes)


def find(version: str) -> Path | None:
    """An interpreter of this version, or None. A shim that leads nowhere is none."""
    return next((path for path in candidates(version) if version_of(path) == version), None)


def candidates(version: str) -> Iterator[Path]:
    """Where an interpreter of this version may be, the most likely place first."""
    name = f"python{version}"
    on_path = shutil.which(name)
    if on_path is not None:
        yield Path(on_path)
    root = pyenv_root()
    if root is not None:
        yield from sorted(root.glob(f"versions/{version}*/bin/{name}"), reverse=True)


def pyenv_root() -> Path | None:
    """The folder of pyenv's interpreters, as it says itself."""
    named = os.environ.get("PYENV_ROOT")
    if named:
        return Path(named)
    if shutil.which("pyenv") is None:
        return None
    said = subprocess.run(["pyenv", "root"], capture_output=True, text=True, check=False).stdout.strip()
    return Path(said) if said else None


def version_of(interpreter: Path) -> str:
    """Major and minor version that an interpreter says it has; "" if it does not run."""
    code = "import sys; print('.'.join(map(str, sys.version_info[:2])))"
    try:
        done = subprocess.run([str(interpreter), "-c", code], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def test(version: str, interpreter: Path, tests: list[str]) -> int:
    """Make the environment of a version and run the tests in it; the exit code of what failed first, or 0."""
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
