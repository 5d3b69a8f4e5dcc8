"""`lingjing new KIND NAME` for kinds of plug-ins that are packages: code, a declaration and tests, ready to install."""

from __future__ import annotations

import keyword
from dataclasses import dataclass
from pathlib import Path

from lingjing.articles import with_article
from lingjing.errors import UsageError
from lingjing.installation import CORE, name_of
from lingjing.plugins.contract import API_VERSION

_TEMPLATES = Path(__file__).parent / "templates"
_COMMON = _TEMPLATES / "common"
"""The files of every package; a file of the kind in the same place replaces one."""
_SUFFIX = ".txt"
_PACKAGE = "package"


@dataclass(frozen=True, slots=True)
class PackageKind:
    """A kind of plug-in that is written as a package."""

    play: str
    """The command that uses it, with `{folder}` and `{name}`."""
    offers: tuple[str, ...] = ()
    """The attributes of the host that will list the plug-in under its name."""


PACKAGES = {
    "backbone": PackageKind(
        "lingjing run ssr --policy react --policy-arg model={name} --policy-arg client={name}",
        ("backbones", "models"),
    ),
    "engine": PackageKind("lingjing run {folder}/missions/tour.ljs --policy {name}", ("engines", "policies")),
    "evaluator": PackageKind("lingjing run ssr --policy oracle --evaluator {name}", ("evaluators",)),
    "scaffold": PackageKind(
        "lingjing run ssr --policy react --policy-arg model=MODEL --policy-arg scaffold={name}", ("scaffolds",)
    ),
    "scene": PackageKind("lingjing run {folder}/missions/visit.ljs --policy random", ("scenes",)),
    "types": PackageKind("lingjing run {folder}/missions/search.ljs --policy random"),
}
"""The kinds by name."""

_RESERVED = ("std", "scenarios", "beacon", "kiosk", "sighting", "react")
"""Names that the templates or the language use."""


def plugin_name(name: str, kind: str = "plug-in") -> str:
    """Return the name as a word of Python and of the language. Raises `UsageError` for a name that is none."""
    from lingjing.dsl.syntax.tokens import INNER, STATEMENTS

    word = name.replace("-", "_").lower()
    letters = word.isidentifier() and word.isascii() and not word.startswith("_")
    is_reserved = keyword.iskeyword(word) or word in STATEMENTS or word in INNER or word in _RESERVED
    if not letters or is_reserved:
        if letters:
            owner = "Python" if keyword.iskeyword(word) else "the language or of this project"
            hint = f"`{word}` is a word of {owner}; choose another name, such as my_{word}"
        else:
            hint = "use letters, digits and _, such as hovercraft"
        thing = "package of types" if kind == "types" else kind
        raise UsageError(f"`{name}` cannot be the name of {with_article(thing)}", hint=hint)
    return word


def write_package(kind: str, name: str, folder: Path | None = None) -> Path:
    """Write the package of a kind into `folder` (default: one of the plug-in's name) and return it.

    Raises `UsageError` if the name is none or is taken, if the folder holds anything, or if it cannot be written.
    """
    word = plugin_name(name, kind)
    _check_free(word, PACKAGES[kind].offers)
    folder = folder or Path(word)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"`{folder}` already exists", hint="nothing is overwritten: choose another folder with -o")
    own = _files(_TEMPLATES / kind)
    try:
        for place, source in sorted({**_files(_COMMON), **own}.items()):
            _write(source, place, folder, word)
    except OSError as error:
        raise UsageError(f"cannot write `{folder}`: {error.strerror}", hint="choose another folder with -o") from error
    return folder


def _check_free(word: str, hooks: tuple[str, ...]) -> None:
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    for hook in hooks:
        if word in getattr(host, hook):
            thing = {"policies": "policy"}.get(hook, hook.removesuffix("s"))
            raise UsageError(
                f"a plug-in called `{word}` ({thing}) exists already",
                hint="choose another name; see `lingjing plugins`",
            )


def _files(folder: Path) -> dict[Path, Path]:
    """The templates of a folder by their place in it."""
    return {file.relative_to(folder): file for file in folder.rglob("*" + _SUFFIX)}


def _write(source: Path, place: Path, folder: Path, word: str) -> None:
    parts = [f"lingjing_{word}" if part == _PACKAGE else part for part in place.parts]
    target = folder.joinpath(*parts).with_suffix("")
    target.parent.mkdir(parents=True, exist_ok=True)
    camel = "".join(part.capitalize() for part in word.split("_"))
    title = word.replace("_", " ").strip().capitalize()
    text = source.read_text(encoding="utf-8")
    words = {"NAME0": word, "Name0": camel, "Title0": title, "CORE0": name_of(CORE), "API0": API_VERSION}
    for placeholder, value in words.items():
        text = text.replace(placeholder, value)
    target.write_text(text, encoding="utf-8")
