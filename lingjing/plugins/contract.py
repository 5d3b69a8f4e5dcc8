"""The version of the plug-in contract, and the modules that belong to it.

A plug-in may import the modules of `CONTRACT_MODULES` and no others; their public names are `__all__`, or, where there
is none, the names without an underscore that the module defines. `docs/plugins.md` describes them and what may change.
"""

from __future__ import annotations

import re

API_VERSION = "1.31"
"""MAJOR.MINOR. A new major version may remove or change a name; a new minor version adds names alone."""

CONTRACT_MODULES = (
    "lingjing.decoding",
    "lingjing.errors",
    "lingjing.mission.instance",
    "lingjing.mission.kinds",
    "lingjing.mission.kinds_format",
    "lingjing.plugins.asking",
    "lingjing.plugins.backbone",
    "lingjing.plugins.bodies",
    "lingjing.plugins.building",
    "lingjing.plugins.calls",
    "lingjing.plugins.chat_model",
    "lingjing.plugins.conformance",
    "lingjing.plugins.contract",
    "lingjing.plugins.decisions",
    "lingjing.plugins.engine",
    "lingjing.plugins.evaluator",
    "lingjing.plugins.fleet",
    "lingjing.plugins.frame_detector",
    "lingjing.plugins.geometry",
    "lingjing.plugins.hookspecs",
    "lingjing.plugins.languages",
    "lingjing.plugins.lookup",
    "lingjing.plugins.model_access",
    "lingjing.plugins.options",
    "lingjing.plugins.policy",
    "lingjing.plugins.prompts",
    "lingjing.plugins.requests",
    "lingjing.plugins.roads",
    "lingjing.plugins.scaffold",
    "lingjing.plugins.step_clock",
    "lingjing.plugins.stock",
    "lingjing.plugins.tasks",
    "lingjing.plugins.terrain",
    "lingjing.plugins.writers",
    "lingjing.scene.city",
    "lingjing.testing",
    "lingjing.trace.calls",
    "lingjing.trace.records",
)

_VERSION = re.compile(r"([0-9]{1,6})\.([0-9]{1,6})")


def version_fault(written_for: object) -> str:
    """The reason for which a plug-in that was written for this version of the contract cannot be used here; "" if it
    can: the major version is the same, and the minor version is not newer."""
    match = _VERSION.fullmatch(written_for) if isinstance(written_for, str) else None
    if match is None:
        return f"it names {written_for!r} as the version of the contract, which is none such as {API_VERSION!r}"
    major, minor = map(int, match.groups())
    own_major, own_minor = map(int, API_VERSION.split("."))
    if major == own_major and minor <= own_minor:
        return ""
    remedy = "a newer lingjing-sim" if (major, minor) > (own_major, own_minor) else "a newer version of the plug-in"
    return f"it is written for version {written_for} of the contract and this is {API_VERSION}: install {remedy}"


__all__ = ["API_VERSION", "CONTRACT_MODULES", "version_fault"]
