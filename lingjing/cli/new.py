"""`lingjing new KIND NAME`: write a file, or a package, that works at once and is easy to change."""

from __future__ import annotations

import argparse
import keyword
from pathlib import Path

from lingjing.cli import newmission
from lingjing.errors import ExitCode, UsageError

_TEMPLATES = Path(__file__).parent / "templates"

KINDS = {
    "agent": "a policy in one file",
    "backbone": "a chat model that react asks",
    "engine": "bodies that move",
    "evaluator": "a score",
    "mission": "a mission in one file",
    "scaffold": "the prompt, memory and parser around react's model",
    "scene": "a city",
    "types": "assets, targets and messages of the language",
}
"""The kinds and what each is; all but agent and mission are packages."""


DEFAULT_FILE = "mission.ljs"
"""The file of a mission from a sentence without a name."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    kinds = "; ".join(f"{name}: {what}" for name, what in KINDS.items())
    parser.add_argument("kind", choices=tuple(KINDS), metavar="KIND", help=kinds)
    parser.add_argument(
        "name",
        metavar="NAME",
        nargs="?",
        help="a name such as scout: scout.py with class Scout, scout.ljs, or the folder scout; with --from: the file's "
        "(default mission)",
    )
    parser.add_argument(
        "-o", "--output", metavar="DIR", help="the folder to write into; a package's own (default: a new one, NAME)"
    )
    newmission.add_options(parser)


def handler(args: argparse.Namespace) -> int:
    """Write the file or the package and print how to use it."""
    if args.sentence is not None:
        return _from_sentence(args)
    if args.name is None:
        raise UsageError(f"the {args.kind} has no name", hint=f"lingjing new {args.kind} NAME")
    if args.model is not None:
        raise UsageError("--model writes a mission from a sentence", hint='add --from "…"')
    if args.kind not in ("agent", "mission"):
        return _new_package(args.kind, args.name, args.output)
    folder = Path(args.output or "")
    if args.kind == "mission":
        path = write_mission(args.name, folder)
        print(f"wrote {path}")
        print(f"check it: lingjing validate {path}")
        print(f"play it: lingjing run {path}")
        return ExitCode.OK
    path, class_name = write_agent(args.name, folder)
    print(f"wrote {path}")
    shown = path if path.is_absolute() else f"./{path}"
    print("install it: a file needs no installation")
    print(f"play it: lingjing run ssr --policy {shown}:{class_name}")
    print(f"test it: python {path}")
    print(f"list its options: lingjing plugins {shown}:{class_name}")
    return ExitCode.OK


def _from_sentence(args: argparse.Namespace) -> int:
    if args.kind != "mission":
        raise UsageError(f"--from writes a mission, and `{args.kind}` is none", hint="lingjing new mission --from …")
    return newmission.write_from_sentence(
        args, Path(args.output or "") / f"{_mission_word(args.name or DEFAULT_FILE)}.ljs"
    )


def _new_package(kind: str, name: str, output: str | None) -> int:
    from lingjing.cli.newpackage import PACKAGES, plugin_name, write_package

    folder = write_package(kind, name, Path(output) if output else None)
    print(f"wrote {folder}")
    print(f"install it: pip install -e {folder}")
    print(f"play it: {PACKAGES[kind].play.format(folder=folder, name=plugin_name(name, kind))}")
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
    word = _mission_word(name)
    title = word.replace("_", " ").strip().capitalize() or word
    text = (_TEMPLATES / "mission.ljs.txt").read_text(encoding="utf-8")
    return _write_new(folder / f"{word}.ljs", text.replace("mission0", word).replace("Title0", title))


def _mission_word(name: str) -> str:
    """Return the name as a word of the language. Raises `UsageError` if it cannot be one."""
    from lingjing.dsl.syntax.tokens import INNER, STATEMENTS

    word = name.removesuffix(".ljs").replace("-", "_")
    if name == DEFAULT_FILE or (word.isidentifier() and word not in STATEMENTS and word not in INNER):
        return word
    hint = "use letters, digits and _, such as bay_search"
    if word.isidentifier():
        hint = f"`{word}` is a word of the language; choose another name, such as my_{word}"
    raise UsageError(f"`{name}` cannot be the name of a mission", hint=hint)


def _write_new(path: Path, text: str) -> Path:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UsageError(f"`{path}` already exists", hint="nothing is overwritten: choose another name") from None
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="change to a folder you may write") from error
    return path
