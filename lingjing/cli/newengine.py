"""`lingjing new engine NAME`: a package with an engine, its types, a policy, a mission and tests, ready to install."""

from __future__ import annotations

import keyword
from pathlib import Path

from lingjing.errors import UsageError
from lingjing.installation import CORE, name_of
from lingjing.plugins.contract import API_VERSION

_TEMPLATE = Path(__file__).parent / "templates" / "engine"
_SUFFIX = ".txt"
_PACKAGE = "package"


def plugin_name(name: str) -> str:
    """The name of the engine, its types and its policy; `UsageError` for what cannot be one."""
    from lingjing.dsl.syntax.tokens import INNER, STATEMENTS

    word = name.replace("-", "_").lower()
    letters = word.isidentifier() and word.isascii() and not word.startswith("_")
    if (
        not letters
        or keyword.iskeyword(word)
        or word in STATEMENTS
        or word in INNER
        or word in ("std", "scenarios", "beacon")
    ):
        hint = "use letters, digits and _, such as hovercraft"
        raise UsageError(f"`{name}` is not a name for an engine", hint=hint)
    return word


def write_engine(name: str, folder: Path | None = None) -> Path:
    """Write the package into `folder` (default: one of the engine's name) and return it.

    `UsageError` if the name is none or is taken, if the folder holds anything, or if it cannot be written.
    """
    word = plugin_name(name)
    _check_free(word)
    folder = folder or Path(word)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"`{folder}` is already there", hint="nothing is overwritten: choose another folder with -o")
    try:
        for source in sorted(_TEMPLATE.rglob("*" + _SUFFIX)):
            _write(source, folder, word)
    except OSError as error:
        raise UsageError(f"cannot write `{folder}`: {error.strerror}", hint="choose another folder with -o") from error
    return folder


def _check_free(word: str) -> None:
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    for kind, taken in (("engine", host.engines), ("policy", host.policies)):
        if word in taken:
            raise UsageError(f"there is {kind} `{word}` already", hint="choose another name; see `lingjing plugins`")


def _write(source: Path, folder: Path, word: str) -> None:
    parts = [f"lingjing_{word}" if part == _PACKAGE else part for part in source.relative_to(_TEMPLATE).parts]
    target = folder.joinpath(*parts).with_suffix("")
    target.parent.mkdir(parents=True, exist_ok=True)
    camel = "".join(part.capitalize() for part in word.split("_"))
    title = word.replace("_", " ").strip().capitalize()
    text = source.read_text(encoding="utf-8")
    words = {"NAME0": word, "Name0": camel, "Title0": title, "CORE0": name_of(CORE), "API0": API_VERSION}
    for placeholder, value in words.items():
        text = text.replace(placeholder, value)
    target.write_text(text, encoding="utf-8")
