"""`lingjing new agent|mission|engine NAME`: write a file, or a package, that works at once and is easy to change."""

from __future__ import annotations

import argparse
import keyword
from pathlib import Path

from lingjing.errors import ExitCode, UsageError

_TEMPLATES = Path(__file__).parent / "templates"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    kinds = ("agent", "mission", "engine")
    parser.add_argument("kind", choices=kinds, metavar="agent|mission|engine", help="what to write")
    parser.add_argument(
        "name", metavar="NAME", help="a name such as scout: scout.py with class Scout, scout.ljs, or the folder scout"
    )
    parser.add_argument(
        "-o", "--output", metavar="DIR", help="the folder to write into; an engine's own (default: a new one, NAME)"
    )


def handler(args: argparse.Namespace) -> int:
    """Write the file and say how to run it."""
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
    from lingjing.cli.newengine import plugin_name, write_engine

    folder = write_engine(name, Path(output) if output else None)
    print(f"wrote {folder}")
    print(f"install it: pip install -e {folder}")
    print(f"play it: lingjing run {folder / 'missions' / 'tour.ljs'} --policy {plugin_name(name)}")
    print(f"test it: pytest {folder}")
    return ExitCode.OK


def write_agent(name: str, folder: Path) -> tuple[Path, str]:
    """Write `<folder>/<name>.py` and return it with the class's name. Never overwrites: `UsageError` instead."""
    module = name.removesuffix(".py").replace("-", "_")
    if not (module.isidentifier() and module.isascii()) or keyword.iskeyword(module):
        raise UsageError(
            f"`{name}` is not a name for a Python file", hint="use letters, digits and _, such as my_scout"
        )
    class_name = "".join(part[:1].upper() + part[1:] for part in module.split("_") if part) or "Agent"
    text = (_TEMPLATES / "agent.py.txt").read_text(encoding="utf-8").replace("Agent0", class_name)
    return _write_new(folder / f"{module}.py", text), class_name


def write_mission(name: str, folder: Path) -> Path:
    """Write `<folder>/<name>.ljs` and return it. Never overwrites: `UsageError` instead."""
    from lingjing.dsl.syntax.tokens import INNER, STATEMENTS

    word = name.removesuffix(".ljs").replace("-", "_")
    if not word.isidentifier() or word in STATEMENTS or word in INNER:
        raise UsageError(f"`{name}` is not a name for a mission", hint="use letters, digits and _, such as bay_search")
    title = word.replace("_", " ").strip().capitalize() or word
    text = (_TEMPLATES / "mission.ljs.txt").read_text(encoding="utf-8")
    return _write_new(folder / f"{word}.ljs", text.replace("mission0", word).replace("Title0", title))


def _write_new(path: Path, text: str) -> Path:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UsageError(f"`{path}` is already there", hint="nothing is overwritten: choose another name") from None
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="change to a folder you may write") from error
    return path
