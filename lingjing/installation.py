"""The installed distributions of this project: names, versions, and the command that installs an extra.

A distribution is identified by the plug-in in its entry points (group `lingjing`), so that a redistribution may have
another name. On public package indexes the name `lingjing` belongs to another party: no message may advise to install
it, and no requirement may name it. This module imports nothing slow, because a cold start imports it.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from functools import cache
from importlib.metadata import Distribution, EntryPoint, PackageNotFoundError, distribution
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from lingjing.installed_plugins.entry_points import PLUGINS, find_entries, present_place


class OwnDistribution(NamedTuple):
    """One of the two distributions of this project."""

    name: str
    """The name."""
    earlier: str
    """The name before version 0.1."""
    plugin: str
    """The module of its plug-in."""


# The name `lingjing` on the public index belongs to another project (ADR 0026).
CORE = OwnDistribution("lingjing-sim", "lingjing", "lingjing.builtin")
AGENTS = OwnDistribution("lingjing-sim-agents", "lingjing-agents", "lingjing_agents.plugin")
OWN = (CORE, AGENTS)


class EarlierRequirement(NamedTuple):
    """A plug-in's distribution that requires one of ours by its earlier name."""

    plugin: str
    """The entry point."""
    owner: str
    """The distribution."""
    required: str
    """The earlier name in its requirements."""
    advice: str
    """The line to change."""


@cache
def installed(own: OwnDistribution) -> Distribution | None:
    """Return the metadata of one of our distributions, or None."""
    for name in (own.name, own.earlier):  # two small files; the search below reads those of every distribution
        candidate = _named(name)
        if candidate is not None and _is(own, candidate):
            return candidate
    return next((point.dist for point in find_entries(PLUGINS).points if point.value == own.plugin), None)


def name_of(own: OwnDistribution) -> str:
    """Return the name to require: as installed, or the present one if there is no metadata or only the earlier name."""
    metadata = installed(own)
    return own.name if metadata is None or canonical(metadata.name) == own.earlier else metadata.name


def version_of(own: OwnDistribution) -> str:
    """Return the installed version; `absent` without metadata."""
    metadata = installed(own)
    return metadata.version if metadata is not None else "absent"


def requirements(*extras: str, of: OwnDistribution = CORE) -> tuple[str, ...]:
    """Return the packages that extras require, sorted, without our own distributions."""
    metadata = installed(of)
    lines = [line.partition(";") for line in (metadata.requires if metadata is not None else None) or ()]
    wanted = {package.strip() for package, _, marker in lines for extra in extras if _selects(marker, extra)}
    own = {name for each in OWN for name in (canonical(name_of(each)), each.name, each.earlier)}
    return tuple(sorted(line for line in wanted if _required_name(line) not in own))


def install_line(*extras: str, of: OwnDistribution = CORE) -> str:
    """Return the command that installs the packages of extras. It does not name our distribution, which is on no index
    yet.
    """
    packages = requirements(*extras, of=of)
    return f"pip install {shlex.join(packages)}" if packages else "run `make setup` in the checkout of this project"


def other_party() -> Distribution | None:
    """Return another party's distribution with the earlier name of one of ours, or None."""
    for own in OWN:
        candidate = _named(own.earlier)
        if candidate is not None and not _is(own, candidate):
            return candidate
    return None


def earlier_left() -> tuple[Distribution, ...]:
    """Return metadata of ours under the earlier names, which an old installation left behind."""
    named = ((own, _named(own.earlier)) for own in OWN)
    return tuple(metadata for own, metadata in named if metadata is not None and _is(own, metadata))


def earlier_requirements() -> Iterator[EarlierRequirement]:
    """Yield plug-ins with distributions that require ours by an earlier name, which would install another party's
    package.
    """
    present = {own.earlier: name_of(own) for own in OWN}
    plugins = {point.name: point.dist for point in find_entries(PLUGINS).points if point.dist is not None}
    for plugin, distribution_of_plugin in sorted(plugins.items()):
        if any(_is(own, distribution_of_plugin) for own in OWN):
            continue
        for line in distribution_of_plugin.requires or ():
            earlier = _required_name(line)
            if earlier in present:
                place = (
                    f"in {folder}/pyproject.toml"
                    if (folder := source_of(distribution_of_plugin))
                    else "in its pyproject.toml"
                )
                advice = f'{place} write "{present[earlier]}" for "{earlier}" in `dependencies`, then install it again'
                yield EarlierRequirement(plugin, distribution_of_plugin.name, earlier, advice)


def repair_advice(is_hidden: bool = False) -> str:
    """Return the commands that restore this project's files after another party's package overwrote or hides them."""
    other, own = other_party(), installed(CORE)
    if other is None and is_hidden:
        return "remove that package, or take its folder out of PYTHONPATH"
    lines = [f"pip uninstall -y {other.name}"] if other is not None else []
    if own is None or not _origin(own).editable:
        source = source_of(own) if own is not None else ""
        lines.append(f"pip install --force-reinstall --no-deps {shlex.quote(source) if source else 'WHEEL'}")
    return " && ".join(lines) or "run `make setup` in the checkout of this project"


def source_of(metadata: Distribution) -> str:
    """Return the local folder or wheel from which a distribution was installed (PEP 610); "" for one from an index."""
    url = urlsplit(_origin(metadata).url)
    return unquote(url.path) if url.scheme == "file" else ""


def canonical(name: str) -> str:
    """Return a distribution's name in the form in which indexes compare it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _required_name(requirement: str) -> str:
    """Return the canonical name at the head of a requirement (PEP 508)."""
    head = re.match(r"\s*[A-Za-z0-9._-]+", requirement)
    return canonical(head[0].strip()) if head else ""


# -- private


class _Origin(NamedTuple):
    url: str = ""
    editable: bool = False


def _origin(metadata: Distribution) -> _Origin:
    try:
        document = json.loads(metadata.read_text("direct_url.json") or "{}")
        return _Origin(str(document.get("url", "")), bool(document.get("dir_info", {}).get("editable")))
    except (ValueError, AttributeError):
        return _Origin()  # another installer's file


def _named(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def _is(own: OwnDistribution, metadata: Distribution) -> bool:
    try:
        return any(_declares(own, point) for point in metadata.entry_points)
    except Exception:  # noqa: BLE001 - another distribution's metadata may be unreadable in any way
        return False


def _declares(own: OwnDistribution, point: EntryPoint) -> bool:
    return point.group == PLUGINS and present_place(point).value == own.plugin


def _selects(marker: str, extra: str) -> bool:
    return re.search(rf"""extra\s*==\s*(['"]){re.escape(extra)}\1""", marker) is not None
