"""The installed distributions of this project: names, versions, and the line that installs what an extra brings.

A distribution is known by the plug-in that its entry points (group `lingjing`) name, so that a redistribution may have
a name of its own. On public package indexes the name `lingjing` belongs to another party: no message may advise to
install it, and no requirement may name it. Nothing here is loaded that a cold start would notice.
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

from lingjing.installed_plugins.entry_points import PLUGINS, find_entries


class OwnDistribution(NamedTuple):
    """One of the two distributions: its `name`, the `earlier` name that it had until 0.1, and the module of its
    `plugin`."""

    name: str
    earlier: str
    plugin: str


# The name `lingjing` on the public index belongs to another project (ADR 0026).
CORE = OwnDistribution("lingjing-sim", "lingjing", "lingjing.engines.builtin")
AGENTS = OwnDistribution("lingjing-sim-agents", "lingjing-agents", "lingjing_agents.plugin")
OWN = (CORE, AGENTS)


class EarlierRequirement(NamedTuple):
    """A plug-in's distribution that requires one of ours by its earlier name: `plugin` is the entry point, `owner` the
    distribution, `required` the name it asks for, `advice` the line to change."""

    plugin: str
    owner: str
    required: str
    advice: str


@cache
def installed(own: OwnDistribution) -> Distribution | None:
    """The metadata of one of ours; None where it is not installed."""
    for name in (own.name, own.earlier):  # two small files; the search below reads those of every distribution
        found = _named(name)
        if found is not None and _is(own, found):
            return found
    return next((point.dist for point in find_entries(PLUGINS).points if point.value == own.plugin), None)


def name_of(own: OwnDistribution) -> str:
    """The name to require: as installed; the present one where the metadata has none or the earlier one."""
    found = installed(own)
    return own.name if found is None or canonical(found.name) == own.earlier else found.name


def version_of(own: OwnDistribution) -> str:
    """The installed version; `absent` without metadata."""
    found = installed(own)
    return found.version if found is not None else "absent"


def requirements(*extras: str, of: OwnDistribution = CORE) -> tuple[str, ...]:
    """What extras ask for beyond the distribution itself, as in its metadata, sorted; ours are left out."""
    found = installed(of)
    lines = [line.partition(";") for line in (found.requires if found is not None else None) or ()]
    wanted = {asked.strip() for asked, _, marker in lines for extra in extras if _selects(marker, extra)}
    own = {name for one in OWN for name in (canonical(name_of(one)), one.name, one.earlier)}
    return tuple(sorted(line for line in wanted if required_name(line) not in own))


def install_line(*extras: str, of: OwnDistribution = CORE) -> str:
    """The line that installs what extras bring. It names their packages and not the distribution, whose name is not
    registered on any index yet."""
    asked = requirements(*extras, of=of)
    return f"pip install {shlex.join(asked)}" if asked else "run `make setup` in the checkout of this project"


def other_party() -> Distribution | None:
    """The distribution of another party that has the earlier name of one of ours."""
    for own in OWN:
        found = _named(own.earlier)
        if found is not None and not _is(own, found):
            return found
    return None


def earlier_left() -> tuple[Distribution, ...]:
    """Metadata of ours under the earlier names, left by an installation from before they changed."""
    named = ((own, _named(own.earlier)) for own in OWN)
    return tuple(found for own, found in named if found is not None and _is(own, found))


def earlier_requirements() -> Iterator[EarlierRequirement]:
    """The plug-ins whose distributions ask for ours by an earlier name, and would have another party's installed."""
    present = {own.earlier: name_of(own) for own in OWN}
    plugins = {point.name: point.dist for point in find_entries(PLUGINS).points if point.dist is not None}
    for plugin, found in sorted(plugins.items()):
        if any(_is(own, found) for own in OWN):
            continue
        for line in found.requires or ():
            earlier = required_name(line)
            if earlier in present:
                place = f"in {folder}/pyproject.toml" if (folder := source_of(found)) else "in its pyproject.toml"
                advice = f'{place} write "{present[earlier]}" for "{earlier}" in `dependencies`, then install it again'
                yield EarlierRequirement(plugin, found.name, earlier, advice)


def repair_advice(is_hidden: bool = False) -> str:
    """The lines that put this project's files back where another party's package overwrote some, or hides them."""
    other, found = other_party(), installed(CORE)
    if other is None and is_hidden:
        return "remove that package, or take its folder out of PYTHONPATH"
    lines = [f"pip uninstall -y {other.name}"] if other is not None else []
    if found is None or not _origin(found).editable:
        source = source_of(found) if found is not None else ""
        lines.append(f"pip install --force-reinstall --no-deps {shlex.quote(source) if source else 'WHEEL'}")
    return " && ".join(lines) or "run `make setup` in the checkout of this project"


def source_of(found: Distribution) -> str:
    """The local folder or wheel that a distribution was installed from (PEP 610); "" for one from an index."""
    url = urlsplit(_origin(found).url)
    return unquote(url.path) if url.scheme == "file" else ""


def canonical(name: str) -> str:
    """A distribution's name as indexes compare it (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def required_name(requirement: str) -> str:
    """The canonical name at the head of a requirement (PEP 508)."""
    head = re.match(r"\s*[A-Za-z0-9._-]+", requirement)
    return canonical(head[0].strip()) if head else ""


# -- private


class _Origin(NamedTuple):
    url: str = ""
    editable: bool = False


def _origin(found: Distribution) -> _Origin:
    try:
        document = json.loads(found.read_text("direct_url.json") or "{}")
        return _Origin(str(document.get("url", "")), bool(document.get("dir_info", {}).get("editable")))
    except (ValueError, AttributeError):
        return _Origin()  # a foreign installer's file


def _named(name: str) -> Distribution | None:
    try:
        return distribution(name)
    except PackageNotFoundError:
        return None


def _is(own: OwnDistribution, found: Distribution) -> bool:
    try:
        return any(_declares(own, point) for point in found.entry_points)
    except Exception:  # noqa: BLE001 - a stranger's file that cannot be parsed
        return False


def _declares(own: OwnDistribution, point: EntryPoint) -> bool:
    return point.group == PLUGINS and point.value == own.plugin


def _selects(marker: str, extra: str) -> bool:
    return re.search(rf"""extra\s*==\s*(['"]){re.escape(extra)}\1""", marker) is not None
