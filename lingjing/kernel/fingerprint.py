"""What an episode's exact numbers depend on beside its inputs: processor features, libraries, graphics.

Digests are promised equal for equal fingerprints (DESIGN section 3).
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
from pathlib import Path

PACKAGES = ("lingjing", "lingjing-agents", "numpy", "jsbsim", "moderngl", "pillow", "opencv-python-headless", "msgspec")


def fingerprint() -> dict[str, str]:
    """A flat table of names and versions, the same on every call in one environment."""
    table = {"python": platform.python_version(), "machine": platform.machine(), "system": platform.system()}
    table["cpu_features"] = cpu_features()
    for name in PACKAGES:
        table[name] = _version(name)
    return table


def cpu_features() -> str:
    """A short hash of the processor's feature flags: floating-point libraries choose their code by them."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return "unknown"
    flags = next((line for line in lines if line.startswith(("flags", "Features"))), "")
    return hashlib.sha256(" ".join(sorted(flags.split())).encode()).hexdigest()[:16]


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "absent"
