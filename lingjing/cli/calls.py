"""`lingjing calls TRACE`: list and print the model calls that the policies of an episode made."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path

import msgspec

from lingjing.cli.arguments import parse_whole
from lingjing.cli.files import check_output, print_columns, say_written, write_output, write_whole
from lingjing.decoding import from_json
from lingjing.errors import ExitCode, UsageError
from lingjing.trace.call_store import CALLS_NAME, CallReader, calls_of
from lingjing.trace.calls import CallResult, RecordedCall
from lingjing.trace.reader import read_trace

_COLUMNS = ("tick", "agent", "call", "pictures", "attempts", "tokens in", "out", "USD", "seconds", "result")
_SHOWN = 60


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("trace", metavar="TRACE", help="a trace, its folder, or the record beside it")
    parser.add_argument("--agent", metavar="NAME", help="only the calls of this agent")
    parser.add_argument("--tick", metavar="N", type=int, help="only the calls at this boundary")
    parser.add_argument("--full", action="store_true", help="print requests and answers in full")
    parser.add_argument(
        "--pictures", metavar="DIR", help="write the pictures of the requests into a folder, named by hash"
    )
    parser.add_argument("--html", metavar="FILE", help="write a page that can be searched; it needs no network")
    parser.add_argument(
        "--inspect",
        metavar="FILE",
        help="write a log for `inspect view` (.eval or .json; pip install inspect_ai)",
    )
    parser.add_argument(
        "--pictures-mb", metavar="MB", default="12", help="the greatest size of all pictures of a page (default 12)"
    )
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print the chosen calls."""
    place = Path(args.trace)
    record = calls_of(place)
    if record is None:
        raise UsageError(
            f"`{place}` has no record of model calls beside it" if place.exists() else f"there is no `{place}`",
            hint=f"an episode whose policies call chat models writes `{CALLS_NAME}` beside its trace",
        )
    if args.html and args.inspect:
        raise UsageError("--html and --inspect write one file each", hint="leave one of them out")
    if args.html or args.inspect:
        return _write_file(record, place, args)
    with closing(CallReader(record)) as reader:
        calls = reader.calls(args.agent, args.tick)
        if args.pictures:
            calls = _writing_pictures(calls, reader, Path(args.pictures))
        if args.output_format == "json":
            _print_json(calls)
        elif args.full:
            _print_full(calls)
        else:
            print_columns([_COLUMNS, *map(_row, calls)])
    return ExitCode.OK


def _write_file(record: Path, place: Path, args: argparse.Namespace) -> int:
    """Write the page or the log. The trace beside the record, if there is one, adds what came of the answers."""
    output = args.html or args.inspect
    budget_mb = parse_whole("--pictures-mb", args.pictures_mb, 2000)
    check_output(output, [str(record)])
    file = next((file for file in (place, *_traces(record)) if file.is_file() and file != record), None)
    trace = None if file is None else read_trace(file)
    with closing(CallReader(record)) as reader:
        if args.html:
            from lingjing.viewer.calls_page import calls_page

            text = calls_page(reader, trace, agent=args.agent, tick=args.tick, budget_bytes=budget_mb * 1_000_000)
            write_output(text, output)
        else:
            from lingjing.viewer.inspect_log import write_inspect_log

            write_inspect_log(reader, trace, Path(output), agent=args.agent)
    if output != "-":
        say_written(output)
    return ExitCode.OK


def _traces(record: Path) -> tuple[Path, Path]:
    return record.with_name("trace.mcap"), record.with_name("trace.mcap.part")


def _print_json(calls: Iterable[RecordedCall]) -> None:
    """Print one object per line, so that a reader can begin before the last one is written."""
    for call in calls:
        whole = {
            "agent": call.agent,
            "tick": call.tick,
            "call": call.number,
            "request": {**from_json(call.head), "messages": [*map(msgspec.Raw, call.messages)]},
            "result": call.result,
        }
        sys.stdout.write(msgspec.json.encode(whole).decode() + "\n")


def _print_full(calls: Iterable[RecordedCall]) -> None:
    for call in calls:
        print(f"=== tick {call.tick}, {call.agent}, call {call.number}: {_outcome(call.result)}")
        for name, value in from_json(call.head).items():
            print(f"{name}: {value if isinstance(value, str) else msgspec.json.encode(value).decode()}")
        for message in map(from_json, call.messages):
            print(f"--- {message.get('role')}\n{_content_text(message.get('content'))}")
        if call.result is not None and call.result.reasoning:
            print(f"--- reasoning\n{call.result.reasoning}")
        if call.result is not None and not call.result.failure:
            print(f"--- answer ({call.result.finish_reason})\n{call.result.text}")
        print()


def _row(call: RecordedCall) -> tuple[str, ...]:
    result = call.result or CallResult(attempts=0)
    cost = "-" if result.cost_usd is None else f"{result.cost_usd:.4f}"
    numbers = (result.attempts, result.prompt_tokens, result.completion_tokens)
    return (
        str(call.tick), call.agent, str(call.number), str(len(call.pictures)), *map(str, numbers), cost,
        f"{result.wall_s:.1f}", _outcome(call.result),
    )  # fmt: skip


def _outcome(result: CallResult | None) -> str:
    if result is None:
        return "no result was recorded"
    text = f"{result.fault}: {result.failure}" if result.failure else " ".join(result.text.split())
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "…"


def _content_text(content: object) -> str:
    """Return the text of a message, with a line for each picture."""
    if not isinstance(content, list):
        return str(content)
    return "\n".join(
        str(part.get("text", "")) if part.get("type") == "text" else f"[picture {part.get('sha256')}]"
        for part in content
    )


def _writing_pictures(calls: Iterable[RecordedCall], reader: CallReader, folder: Path) -> Iterator[RecordedCall]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write into `{folder}`: {error.strerror}", hint="name another folder") from error
    for call in calls:
        for name in call.pictures:
            hashed = bytes.fromhex(name) if len(name) == 64 and set(name) <= set("0123456789abcdef") else b""
            write_whole(str(folder / f"{hashed.hex() or 'unnamed'}.jpg"), reader.content(hashed))
        yield call
