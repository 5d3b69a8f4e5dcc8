"""`lingjing new agent|mission|engine NAME`: write a policy, a mission or an engine package that works as it is.

An engine package holds the engine, its types, a policy, a mission and tests, ready to install.
"""

from __future__ import annotations

import argparse
import keyword
from pathlib import Path

from lingjing.errors import ExitCode, UsageError

_TEMPLATES = Path(__file__).parent / "templates"
_ENGINE_TEMPLATE = _TEMPLATES / "engine"
_SUFFIX = ".txt"
_PACKAGE = "package"
"""The folder of the template that gets the package's name."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    kinds = ("agent", "mission", "engine")
    parser.add_argument("kind", choices=kinds, metavar="agent|mission|engine", help="the kind of file or package")
    parser.add_argument(
        "name", metavar="NAME", help="a name such as scout: scout.py with class Scout, scout.ljs, or the folder scout"
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        help="the folder to write into; for an engine the package's folder (default NAME)",
    )


def handler(args: argparse.Namespace) -> int:
    """Write the files and print the commands that run them."""
    if args.kind == "engine":
        return _new_engine(args.name, args.output)
    folder = Path(args.output or "")
    if args.kind == "mission":
        path = write_mission(args.name, folder)
        print(f"wrote {path}")
        print(f"play it: lingjing run {path}")
        return ExitCode.OK
    path, class_name = write_agent(args.name, folder)
    print(f"wrote {path}")
    shown = path if path.is_absolute() else f"./{path}"
    print(f"play it: lingjing run ssr --policy {shown}:{class_name}")
    return ExitCode.OK


def _new_engine(name: str, output: str | None) -> int:
    folder = write_engine(name, Path(output) if output else None)
    print(f"wrote {folder}")
    print(f"install it: pip install -e {folder}")
    print(f"play it: lingjing run {folder / 'missions' / 'tour.ljs'} --policy {plugin_name(name)}")
    print(f"test it: pytest {folder}")
    return ExitCode.OK


def write_agent(name: str, folder: Path) -> tuple[Path, str]:
    """Write `<folder>/<name>.py`; return its path and the class's name. Raises `UsageError` if the file exists."""
    module = name.removesuffix(".py").replace("-", "_")
    if not (module.isidentifier() and module.isascii()) or keyword.iskeyword(module):
        raise UsageError(
            f"`{name}` cannot be the name of a Python file", hint="use letters, digits and _, such as my_scout"
        )
    class_name = "".join(part[:1].upper() + part[1:] for part in module.split("_") if part) or "Agent"
    text = (_TEMPLATES / "agent.py.txt").read_text(encoding="utf-8").replace("Agent0", class_name)
    return _write_new(folder / f"{module}.py", text), class_name


def write_mission(name: str, folder: Path) -> Path:
    """Write `<folder>/<name>.ljs` and return its path. Raises `UsageError` if the file exists."""
    from lingjing.dsl.syntax.tokens import INNER, STATEMENTS

    word = name.removesuffix(".ljs").replace("-", "_")
    if not word.isidentifier() or word in STATEMENTS or word in INNER:
        raise UsageError(
            f"`{name}` cannot be the name of a mission", hint="use letters, digits and _, such as bay_search"
        )
    title = word.replace("_", " ").strip().capitalize() or word
    text = (_TEMPLATES / "mission.ljs.txt").read_text(encoding="utf-8")
    return _write_new(folder / f"{word}.ljs", text.replace("mission0", word).replace("Title0", title))


def plugin_name(name: str) -> str:
    """Return the name of the engine, its types and its policy. Raises `UsageError` for an unsuitable name."""
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
        raise UsageError(f"`{name}` cannot be the name of an engine", hint=hint)
    return word


def write_engine(name: str, folder: Path | None = None) -> Path:
    """Write the package into `folder` (default: a folder with the engine's name) and return the folder.

    Raises `UsageError` for an unsuitable or used name, a folder that is not empty, or one that cannot be written.
    """
    word = plugin_name(name)
    _check_free(word)
    folder = folder or Path(word)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"`{folder}` already exists", hint="nothing is overwritten: choose another folder with -o")
    try:
        for source in sorted(_ENGINE_TEMPLATE.rglob("*" + _SUFFIX)):
            _write_from_template(source, folder, word)
    except OSError as error:
        raise UsageError(f"cannot write `{folder}`: {error.strerror}", hint="choose another folder with -o") from error
    return folder


def _check_free(word: str) -> None:
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    for kind, names in (("engine", host.engines), ("policy", host.policies)):
        if word in names:
            raise UsageError(
                f"a plug-in called `{word}` ({kind}) exists already", hint="choose another name; see `lingjing plugins`"
            )


def _write_from_template(source: Path, folder: Path, word: str) -> None:
    from lingjing.installation import CORE, name_of
    from lingjing.plugins.contract import API_VERSION

    parts = [f"lingjing_{word}" if part == _PACKAGE else part for part in source.relative_to(_ENGINE_TEMPLATE).parts]
    target = folder.joinpath(*parts).with_suffix("")
    target.parent.mkdir(parents=True, exist_ok=True)
    camel = "".join(part.capitalize() for part in word.split("_"))
    title = word.replace("_", " ").strip().capitalize()
    text = source.read_text(encoding="utf-8")
    words = {"NAME0": word, "Name0": camel, "Title0": title, "CORE0": name_of(CORE), "API0": API_VERSION}
    for placeholder, value in words.items():
        text = text.replace(placeholder, value)
    target.write_text(text, encoding="utf-8")


def _write_new(path: Path, text: str) -> Path:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UsageError(f"`{path}` already exists", hint="nothing is overwritten: choose another name") from None
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="change to a folder you may write") from error
    return path
