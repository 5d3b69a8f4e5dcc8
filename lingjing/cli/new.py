"""`lingjing new agent NAME`: write a policy in one file that runs at once and is easy to change."""

from __future__ import annotations

import argparse
import keyword
from pathlib import Path

from lingjing.errors import ExitCode, UsageError

_TEMPLATE = Path(__file__).parent / "templates" / "agent.py.txt"


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the verb and its options."""
    parser = subparsers.add_parser("new", help="write a file to start from", description=__doc__)
    parser.add_argument("kind", choices=("agent",), metavar="agent", help="what to write")
    parser.add_argument("name", metavar="NAME", help="a Python name, such as scout; the class is then Scout")


def handler(args: argparse.Namespace) -> int:
    """Write the file and say how to run it."""
    path, class_name = write_agent(args.name, Path())
    print(f"wrote {path}")
    print(f"play it: lingjing run ssr --policy ./{path}:{class_name}")
    return ExitCode.OK


def write_agent(name: str, folder: Path) -> tuple[Path, str]:
    """Write `<folder>/<name>.py` and return it with the class's name. Never overwrites: `UsageError` instead."""
    module = name.removesuffix(".py").replace("-", "_")
    if not (module.isidentifier() and module.isascii()) or keyword.iskeyword(module):
        raise UsageError(
            f"`{name}` is not a name for a Python file", hint="use letters, digits and _, such as my_scout"
        )
    class_name = "".join(part[:1].upper() + part[1:] for part in module.split("_") if part) or "Agent"
    path = folder / f"{module}.py"
    text = _TEMPLATE.read_text(encoding="utf-8").replace("Agent0", class_name)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise UsageError(f"`{path}` is already there", hint="nothing is overwritten: choose another name") from None
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="change to a folder you may write") from error
    return path, class_name
