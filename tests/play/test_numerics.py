"""Libraries that choose code by processor are pinned where they decide outcomes, or the report names the risk."""

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import msgspec
import pytest

from lingjing import numerics
from lingjing.errors import UsageError
from lingjing.play import selfcheck

CHILD = Path(__file__).with_name("numerics_child.py")
AVX2 = frozenset({"avx2", "fma"})
SKYLAKE = AVX2 | {"avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"}
ZEN4 = SKYLAKE | {"avx512_vnni", "avx512_bitalg", "avx512ifma", "avx512vbmi"}

needs_avx2 = pytest.mark.skipif(
    not numerics.processor_flags().issuperset(AVX2), reason="no digest is promised without AVX2 and FMA"
)

KERNELS = ("Nehalem", "Haswell", "SkylakeX")
"""Kernels of OpenBLAS for processors of three generations."""

PROCESSORS = (
    {
        "OPENBLAS_CORETYPE": "Nehalem",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3",
        "OPENCV_CPU_DISABLE": "AVX2",
        "OPENCV_IPP": "disabled",
        "OPENBLAS_NUM_THREADS": "2",
    },
    {"OPENBLAS_CORETYPE": "SkylakeX", "NPY_DISABLE_CPU_FEATURES": "X86_V4"},
)
"""An old and a new processor, tried on one machine by the variants that the libraries would choose there."""


def python(*arguments: str, check: bool = True, **settings: str) -> subprocess.CompletedProcess[str]:
    """Run Python with these settings, without the numeric settings of this process."""
    names = {*numerics.pins(), *settings, "GLIBC_TUNABLES"}
    environment = {name: value for name, value in os.environ.items() if name not in names} | settings
    return subprocess.run([sys.executable, *arguments], env=environment, capture_output=True, text=True, check=check)


def played(*arguments: str, **settings: str) -> dict:
    return json.loads(python(str(CHILD), *arguments, **settings).stdout)


@cache
def plain() -> dict:
    return played("process")


needs_glibc = pytest.mark.skipif(
    numerics.runtime_fingerprint()["libm"] not in {"fma", "no fma"},
    reason="a C library whose variants nobody has looked at",
)


@needs_avx2
@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [pytest.param(PROCESSORS[0], id="old"), pytest.param(PROCESSORS[1], id="new", marks=pytest.mark.thorough)],
)
def test_the_digest_is_the_same_on_every_processor(settings):
    """A dog, a van and a UAV with commands, and UAVs that look for what pictures show: the same to the last bit, and
    every process really ran the pinned code."""
    assert plain()["reasons"] == ["budget", "budget"]
    result = played("process", **settings)
    assert result == plain()
    for processes in result["processes"]:
        assert set(processes) == {"caller", "world", "camera"}
        for table in processes.values():
            assert table["numpy"] == "X86_V3"
            blas = [value for name, value in table.items() if name.startswith("openblas")]
            assert set(blas) == {"Haswell, 1 thread"}
    heuristic = result["processes"][1]["caller"]
    assert heuristic["opencv"] == "SSE4.1 SSE4.2 AVX FP16 AVX2, IPP AVX2"
    assert result["withdrawn"] == [[], []]


@needs_avx2
def test_engines_in_the_caller_are_pinned_as_well():
    inline = played("inline", "short", OPENBLAS_CORETYPE="Nehalem")
    assert (inline["digests"], inline["frames"]) == (plain()["digests"][:1], plain()["frames"][:1])
    assert set(inline["processes"][0]) == {"caller"}
    assert inline["withdrawn"] == plain()["withdrawn"][:1]


def runs_here(kernel: str) -> bool:
    """Return whether this processor has the instructions of the kernel; a process without them is killed."""
    return kernel != "SkylakeX" or numerics.processor_flags().issuperset(SKYLAKE)


_PRODUCTS = """
import hashlib, sys
from lingjing import numerics
from lingjing.errors import UsageError
if len(sys.argv) > 1:
    numerics.pin()
import numpy as np
draw = np.random.default_rng(1)
value = draw.standard_normal((1, 45)).astype(np.float32)
for size in (512, 256, 128, 12):
    value = np.tanh(value @ draw.standard_normal((value.shape[1], size)).astype(np.float32))
print(hashlib.sha256(value.tobytes()).hexdigest())
"""


@needs_avx2
def test_without_pins_the_output_of_a_network_depends_on_the_processor():
    """The output of a perceptron of the dog's size in 32 bits differs in its last bit, which a walk amplifies.

    (The dog's own perceptron is summed in 64 bits, so that episodes of its engine do not differ.)
    """
    pinned = {python("-c", _PRODUCTS, "pin", OPENBLAS_CORETYPE=kernel).stdout for kernel in KERNELS}
    free = {python("-c", _PRODUCTS, OPENBLAS_CORETYPE=kernel).stdout for kernel in KERNELS if runs_here(kernel)}
    assert len(pinned) == 1
    assert len(free) > 1


@needs_avx2
@needs_glibc
@pytest.mark.thorough
def test_without_the_pins_an_episode_has_another_digest():
    """The C library without FMA: pinned, the workers run what the processor has; unpinned, they take what they are
    given."""
    without_fma = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA"}
    pinned, free = (played("process", "short", *more, **without_fma) for more in ((), ("unpinned",)))
    assert pinned["digests"] == plain()["digests"][:1]
    assert free["digests"] != pinned["digests"]
    (withdrawn,) = pinned["withdrawn"]
    assert withdrawn == ["caller: the C library computes without FMA"]
    assert {line.partition(":")[0] for line in free["withdrawn"][0]} == {"caller", "world", "camera"}


_NUMPY_FIRST = """
import numpy, sys
import lingjing
from lingjing.play import selfcheck
from lingjing.testing import shortened
mission = shortened(selfcheck.MISSION, 1)
result = lingjing.run(mission, policy=selfcheck.Scripted, seed=7, out=sys.argv[1], overview=False)
print(*result.withdrawn, *result.warnings, sep="\\n")
"""


@needs_avx2
def test_an_import_of_numpy_before_the_pins_withdraws_the_promise_of_equal_digests(tmp_path):
    lines = python("-c", _NUMPY_FIRST, str(tmp_path / "run"), OPENBLAS_CORETYPE="Nehalem").stdout.splitlines()
    named = [line for line in lines if line.startswith("caller: openblas of numpy runs Nehalem, ")]
    assert len(named) == 1
    assert lines[-1].startswith("this digest is not promised on other processors: caller: ")
    assert "`lingjing.pin()` before numpy is imported" in lines[-1]


@needs_avx2
def test_pin_returns_whether_it_took_effect_before_numpy():
    code = (
        "import lingjing; print(lingjing.pin()); import numpy; "
        "print(lingjing.pin(), lingjing.numerics.runtime_fingerprint())"
    )
    lines = python("-c", code, OPENBLAS_CORETYPE="Nehalem").stdout.splitlines()
    assert lines[0] == "True"
    assert lines[1].startswith("False ")
    assert "'openblas of numpy': 'Haswell, 1 thread'" in lines[1]


_DOCTOR = """
from lingjing.numerics import pin
pin()
import sys
from functools import cache
from pathlib import Path
from lingjing.cli.main import main
from lingjing.play import selfcheck

selfcheck._play = cache(selfcheck._play)  # one episode for three comparisons
codes = [main(["doctor", "--numerics", "--output-format", "json"])]
for other in sys.argv[1:]:
    selfcheck.STORED = Path(other)
    codes.append(main(["doctor", "--numerics"]))
print(codes)
"""


@needs_avx2
def test_doctor_confirms_the_stored_digest_and_reports_differences_from_another(tmp_path):
    """Compare one episode with the stored digest, with another one and with a file that is missing."""
    stored = msgspec.json.decode(selfcheck.STORED.read_bytes(), type=selfcheck.Computed)
    other = msgspec.structs.replace(stored, digest="0" * 64, versions={**stored.versions, "mujoco": "2.9"})
    (tmp_path / "other.json").write_bytes(msgspec.json.encode(other))
    done = python("-c", _DOCTOR, str(tmp_path / "other.json"), str(tmp_path / "none.json"))
    first, end = json.JSONDecoder().raw_decode(done.stdout)
    findings = {finding["name"]: finding for finding in first}
    assert list(findings) == ["caller", "camera", "world", "episode"]
    assert "BAD episode: digest " in done.stdout[end:]
    assert "mujoco is 3.17.0, was 2.9" in done.stdout[end:]
    assert "cannot be read" in done.stdout[end:]
    libc = numerics.versions()["libc"]
    if not findings["episode"]["ok"] and libc != stored.versions["libc"]:
        pytest.skip(f"stored with {stored.versions['libc']}, this is {libc}: {findings['episode']}")
    assert findings["episode"]["ok"], findings
    assert done.stdout.splitlines()[-1] == "[0, 3, 3]"


def test_pins_name_only_features_of_the_processor():
    """numpy warns of groups that are not there, OpenCV writes of them to standard error."""
    assert numerics.pins(AVX2)["NPY_DISABLE_CPU_FEATURES"] == numerics.pins(AVX2)["OPENCV_CPU_DISABLE"] == ""
    assert numerics.pins(SKYLAKE)["NPY_DISABLE_CPU_FEATURES"] == "X86_V4"
    assert numerics.pins(ZEN4)["NPY_DISABLE_CPU_FEATURES"] == "X86_V4 AVX512_ICL"
    assert numerics.pins(ZEN4)["OPENCV_CPU_DISABLE"] == "AVX512-SKX"
    assert [numerics.pins(flags)["OPENCV_IPP"] for flags in (AVX2, ZEN4, frozenset())] == ["avx2", "avx2", ""]
    assert numerics.pins(frozenset({"sse4_2"}))["OPENBLAS_CORETYPE"] == ""


@pytest.fixture
def numpy_version_anew():
    """Read the version of numpy anew in a test, and after it."""
    numerics._numpy_version.cache_clear()
    yield
    numerics._numpy_version.cache_clear()


def test_pins_use_the_former_feature_names_for_numpy_1(monkeypatch, numpy_version_anew):
    monkeypatch.setattr(numerics, "_version", lambda name: "1.26.4")
    assert numerics.pins(SKYLAKE)["NPY_DISABLE_CPU_FEATURES"] == "AVX512F AVX512CD AVX512_SKX"


def test_unreadable_metadata_of_numpy_is_a_usage_error(monkeypatch, numpy_version_anew):
    """Python 3.11 returns None for it, Python from 3.12 on raises `KeyError`."""
    monkeypatch.setattr(numerics.importlib.metadata, "version", lambda name: None)
    with pytest.raises(UsageError, match="the metadata of the package `numpy` cannot be read"):
        numerics.pins(AVX2)

    def version(name):
        raise KeyError("Version")

    monkeypatch.setattr(numerics.importlib.metadata, "version", version)
    with pytest.raises(UsageError, match="the metadata of the package `numpy` cannot be read") as raised:
        numerics.pins(AVX2)
    assert "pip show -f numpy" in raised.value.hint


def test_the_environment_of_a_worker_overrides_numeric_settings_of_the_user():
    mine = {"OPENBLAS_CORETYPE": "Nehalem", "NPY_ENABLE_CPU_FEATURES": "X86_V4", "PATH": "/bin",
            "GLIBC_TUNABLES": "glibc.malloc.check=1:glibc.cpu.hwcaps=-FMA"}  # fmt: skip
    pinned = numerics.worker_environment(mine)
    assert pinned["OPENBLAS_CORETYPE"] == numerics.pins()["OPENBLAS_CORETYPE"]
    assert "NPY_ENABLE_CPU_FEATURES" not in pinned
    assert (pinned["PATH"], pinned["GLIBC_TUNABLES"]) == ("/bin", "glibc.malloc.check=1")
    assert pinned["OMP_NUM_THREADS"] == "1"
    assert mine["OPENBLAS_CORETYPE"] == "Nehalem"


GOOD = {"processor": "avx2, fma", "libm": "fma", "numpy": "X86_V3", "openblas of numpy": "Haswell, 1 thread"}


@pytest.mark.parametrize(
    ("change", "messages"),
    [
        ({}, ()),
        ({"opencv": "SSE4.1 AVX2, IPP AVX2"}, ()),
        ({"numpy": "SSE42 AVX F16C FMA3 AVX2"}, ()),
        ({"numpy": "X86_V3 X86_V4"}, ("numpy runs X86_V3 X86_V4, not X86_V3",)),
        ({"numpy": "none"}, ("numpy runs none, not X86_V3",)),
        ({"openblas of scipy": "Zen, 2 threads"}, ("openblas of scipy runs Zen, 2 threads, not Haswell, 1 thread",)),
        ({"opencv": "AVX2 AVX512-SKX, IPP AVX2"}, ("OpenCV runs AVX2 AVX512-SKX, IPP AVX2, not AVX2",)),
        ({"processor": "without fma"}, ("the processor is without fma",)),
        ({"libm": "no fma"}, ("the C library computes without FMA",)),
        ({"libm": "0123456789abcdef"}, ()),
    ],
)
def test_deviations_are_named(change, messages):
    assert numerics.deviations({**GOOD, **change}) == messages


def test_a_library_replaced_by_a_policy_is_reported(monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", object())
    table = numerics.runtime_fingerprint()
    assert table["opencv"] == "what cannot be told (AttributeError)"
    assert any(message.startswith("OpenCV runs what cannot be told") for message in numerics.deviations(table))


def test_another_library_than_openblas_is_named():
    table = {name: value for name, value in GOOD.items() if not name.startswith("openblas")}
    assert numerics.deviations(table) == ("numpy computes with another library than OpenBLAS",)
    assert numerics.withdrawn({"caller": table, "world": GOOD}) == (
        "caller: numpy computes with another library than OpenBLAS",
    )


_VALIDATE = """
import sys
from lingjing.cli.main import main
main(["validate", sys.argv[1]])
print("lingjing.numerics" in sys.modules)
"""


def test_validate_does_not_load_the_numerics_module():
    """`lingjing validate` plays nothing, and pins nothing."""
    assert python("-c", _VALIDATE, str(selfcheck.MISSION)).stdout.splitlines()[-1] == "False"
