"""The factors beside its inputs that determine the last bits of an episode's numbers, and how they are fixed.

numpy, OpenBLAS, OpenCV and the C library select code by the processor, and each variant rounds differently. `pins` are
the environment variables that make the libraries select the code of every x86-64 processor with AVX2 and FMA; they take
effect before the libraries are loaded. `runtime_fingerprint` reads the actual selection, and `deviations` lists where
it violates the conditions of equal digests (ADR 0013).
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.metadata
import math
import os
import platform
import re
import sys
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from functools import cache
from pathlib import Path
from types import ModuleType

from lingjing import installation
from lingjing.errors import UsageError

PACKAGES = (
    "numpy", "scipy", "jsbsim", "mujoco", "libsumo", "sgp4", "shapely", "moderngl",
    "pillow", "opencv-python-headless", "msgspec",
)  # fmt: skip
"""The packages with versions that may change numbers."""

CORE, GROUP = "Haswell", "X86_V3"
"""The kernels of OpenBLAS and the highest instruction group of numpy under which digests are equal on all
processors.
"""

_TELLING: tuple[tuple[Callable[[float], float], tuple[int, ...]], ...] = (
    (math.sin, (23, 5942, 14264)),
    (math.cos, (628, 705, 5009)),
    (lambda x: math.exp(-x), (453, 1175, 3225)),
    (lambda x: x**0.7, (1093, 2410, 2503)),
)
"""Functions and arguments (indices of 20,000 numbers) at which glibc's results differ with and without FMA."""

_VARIANTS = {"b5ac67229f693208": "fma", "09e02522b6f122d3": "no fma"}
"""The variant by the hash of these results, with glibc from 2.28."""

_NEEDED = ("avx2", "fma")
"""Processor features that equal digests require."""
_THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "BLIS_NUM_THREADS")
"""Environment variables for the number of threads of each library."""
_LATER_GROUPS = (("X86_V4", "avx512vl"), ("AVX512_ICL", "avx512_bitalg"), ("AVX512_SPR", "avx512_fp16"))
_EARLIER_GROUPS = (
    ("AVX512F", "avx512f"), ("AVX512CD", "avx512cd"), ("AVX512_SKX", "avx512vl"), ("AVX512_CLX", "avx512_vnni"),
    ("AVX512_CNL", "avx512_vbmi"), ("AVX512_ICL", "avx512_bitalg"), ("AVX512_SPR", "avx512_fp16"),
)  # fmt: skip
"""Instruction groups by which numpy selects code, from 2.4 (`_LATER_GROUPS`) and before, with the processor flag of
each: numpy warns about a disabled group that the processor does not have.
"""

_REGROUPED = (2, 4)
"""The version of numpy from which on `_LATER_GROUPS` apply."""
_OPENCV_GROUP = ("AVX512-SKX", "avx512vl")
_IDLE = ("libsumo",)
"""Owners of copies of OpenBLAS without influence: SUMO ships one for GDAL, which a simulation does not call."""

_CORE_NAMES = ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename")
_THREAD_NAMES = ("scipy_openblas_get_num_threads64_", "scipy_openblas_get_num_threads", "openblas_get_num_threads")


def pins(flags: frozenset[str] | None = None) -> dict[str, str]:
    """Return the environment variables that fix the selection of code, by the processor's `flags` (default: this
    one's).

    A variable with an empty value must be unset: the library's default is right, and a setting of the user may not be.
    """
    have = processor_flags() if flags is None else flags
    opencv, flag = _OPENCV_GROUP
    groups = _LATER_GROUPS if _numpy_version() >= _REGROUPED else _EARLIER_GROUPS
    return {
        "OPENBLAS_NUM_THREADS": "1",
        "OPENBLAS_CORETYPE": CORE if have.issuperset(_NEEDED) else "",
        "NPY_DISABLE_CPU_FEATURES": " ".join(name for name, flag_of_group in groups if flag_of_group in have),
        "NPY_ENABLE_CPU_FEATURES": "",
        "OPENCV_CPU_DISABLE": opencv if flag in have else "",
        "OPENCV_IPP": "avx2" if "avx2" in have else "",
        "LP_NATIVE_VECTOR_WIDTH": "256" if "avx2" in have else "",
    }


def pin() -> bool:
    """Pin this process and those that it starts, so that each processor gives the same digests.

    Call it before numpy is imported. Returns False if that is too late.

    >>> import numpy
    >>> lingjing.pin()
    False
    """
    _apply(pins(), os.environ)
    return "numpy" not in sys.modules and "cv2" not in sys.modules


def worker_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return `environment` with the pins, one thread for every library, and the C library's default selection."""
    pinned = dict(environment)
    _apply({**pins(), **dict.fromkeys(_THREADS, "1")}, pinned)
    tunables = (part for part in pinned.get("GLIBC_TUNABLES", "").split(":") if not part.startswith("glibc.cpu."))
    _apply({"GLIBC_TUNABLES": ":".join(tunables)}, pinned)
    return pinned


def runtime_fingerprint() -> dict[str, str]:
    """Return the code selection of this process for its loaded libraries, as names and texts.

    Never raises: a policy may have replaced a library.
    """
    flags = processor_flags()
    missing = [name for name in _NEEDED if name not in flags]
    table = {"processor": f"without {', '.join(missing)}" if missing else "avx2, fma", "libm": _libm()}
    numpy, cv2 = sys.modules.get("numpy"), sys.modules.get("cv2")
    if numpy is not None:
        table["numpy"] = _value_or_error(lambda: " ".join(_numpy_groups()) or "none")
        table |= {f"openblas of {owner}": kernels for owner, kernels in _openblas()}
    if cv2 is not None:
        table["opencv"] = _value_or_error(lambda: _opencv(cv2))
    return table


def deviations(table: Mapping[str, str]) -> tuple[str, ...]:
    """Return the entries of a `runtime_fingerprint` on which the promise of one digest does not stand.

    Each names the library, what it runs and what it should run.
    """
    if "processor" not in table:
        return ()
    texts = []
    if table["processor"].startswith("without"):
        texts.append(f"the processor is {table['processor']}")
    if table.get("libm") == "no fma":
        texts.append("the C library computes without FMA")
    if "numpy" in table:
        above = [name for name in table["numpy"].split() if _is_above(name)]
        if above or not {GROUP, "AVX2"}.intersection(table["numpy"].split()):
            texts.append(f"numpy runs {table['numpy']}, not {GROUP}")
        blas = [name for name in table if name.startswith("openblas")]
        texts += [f"{name} runs {table[name]}, not {_due()}" for name in blas if table[name] != _due()]
        if not blas:
            texts.append("numpy computes with another library than OpenBLAS")
    if "opencv" in table and ("AVX512" in table["opencv"] or "AVX2" not in table["opencv"]):
        texts.append(f"OpenCV runs {table['opencv']}, not AVX2")
    return tuple(texts)


def withdrawn(processes: Mapping[str, Mapping[str, str]]) -> tuple[str, ...]:
    """Return the deviations of all processes of an episode, each with the process's name."""
    return tuple(f"{place}: {deviation}" for place, table in processes.items() for deviation in deviations(table))


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of Python, the C library and the packages; the same on every call in one environment."""
    table = {"python": platform.python_version(), "machine": platform.machine(), "system": platform.system()}
    table["libc"] = " ".join(platform.libc_ver()).strip() or "unknown"
    own = {  # names in traces, whatever the distributions are called
        "lingjing": installation.version_of(installation.CORE),
        "lingjing-agents": installation.version_of(installation.AGENTS),
    }
    return table | own | {name: _version(name) for name in PACKAGES}


def processor_flags() -> frozenset[str]:
    """Return the processor's features by their kernel names; empty if the system does not list them."""
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as file:
            line = next((line for line in file if line.startswith(("flags", "Features"))), "")
    except OSError:
        return frozenset()
    return frozenset(line.partition(":")[2].split())


def _apply(wanted: Mapping[str, str], environment: MutableMapping[str, str]) -> None:
    for name, value in wanted.items():
        if value:
            environment[name] = value
        else:
            environment.pop(name, None)


def _due() -> str:
    return f"{CORE}, {_threads(1)}"


def _is_above(group: str) -> bool:
    """Return whether an instruction group of numpy is beyond those of every processor with AVX2."""
    return group.startswith("AVX512") or group == "X86_V4"


def _value_or_error(read: Callable[[], str]) -> str:
    try:
        return read()
    except Exception as error:  # noqa: BLE001 - see `runtime_fingerprint`
        return f"what cannot be told ({type(error).__name__})"


def _numpy_groups() -> list[str]:
    parts = ("numpy._core._multiarray_umath", "numpy.core._multiarray_umath")  # the second before numpy 2.0
    umath = next(sys.modules[name] for name in parts if name in sys.modules)
    return [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__.get(name)]


def _openblas() -> Iterator[tuple[str, str]]:
    """Yield each copy of OpenBLAS in this process: the package that brought it, its kernels and threads."""
    mapped = Path("/proc/self/maps")
    lines = mapped.read_text(encoding="utf-8", errors="replace").splitlines() if mapped.exists() else []
    for path in sorted({line.split(maxsplit=5)[-1] for line in lines if "openblas" in line and ".so" in line}):
        library = _library(path)
        if library is None:
            continue
        name_of_core = next((name for name in _CORE_NAMES if hasattr(library, name)), "")
        name_of_threads = next((name for name in _THREAD_NAMES if hasattr(library, name)), "")
        owner = Path(path).parent.name.removesuffix(".libs")
        if not name_of_core or not name_of_threads or owner in _IDLE:
            continue
        core = library[name_of_core]
        core.restype = ctypes.c_char_p
        count = int(library[name_of_threads]())
        yield owner, f"{core().decode()}, {_threads(count)}"


@cache
def _library(path: str) -> ctypes.CDLL | None:
    """Return a loaded library, or None for a file that is only mapped. Cached, because each handle takes memory for
    good.
    """
    try:
        return ctypes.CDLL(path, mode=os.RTLD_NOLOAD)
    except OSError:
        return None


def _threads(count: int) -> str:
    return f"{count} thread{'s' if count != 1 else ''}"


def _opencv(cv2: ModuleType) -> str:
    """Return the instruction groups of OpenCV's dispatch, and the code of Intel's library in it."""
    groups = [word[1:] for word in cv2.getCPUFeaturesLine().split() if word.startswith("*") and not word.endswith("?")]
    ipp = re.sub(r"^ippIP | \(.*", "", cv2.ipp.getIppVersion()) if cv2.ipp.useIPP() else "none"
    return f"{' '.join(groups)}, IPP {ipp}"


@cache
def _libm() -> str:
    """Return the variant of the C library's functions, by their results where the variants differ."""
    values = [function(0.00731 * k + 0.001).hex() for function, points in _TELLING for k in points]
    known = hashlib.sha256(" ".join(values).encode()).hexdigest()[:16]
    return _VARIANTS.get(known, known)


@cache
def _numpy_version() -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", _version("numpy"))[:2])


def _version(name: str) -> str:
    try:
        version = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "absent"
    except KeyError:  # Python from 3.12 on, for an unreadable file
        version = ""
    if not version:  # and Python 3.11
        raise UsageError(
            f"the metadata of the package `{name}` cannot be read",
            hint=f"see who may read it (`pip show -f {name}`), or install it again",
        )
    return version
