"""`lingjing new mission --from SENTENCE`: a mission from a sentence, by a chat model, or the prompt for one."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import parse_amount, parse_pairs, whole_number
from lingjing.cli.files import check_output, write_whole
from lingjing.cli.process import ending_at_second_interrupt, results_alone, say
from lingjing.errors import ExitCode, InfrastructureError, UsageError

if TYPE_CHECKING:
    from lingjing.authoring.drafting import Draft, DraftRound
    from lingjing.plugins.writers import MissionWriter

WRITER = "chat"
"""The writer of the reference agents."""
MOST_ROUNDS = 50
_LONGEST = 20_000
"""Most letters of a sentence (chosen)."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `--from`."""
    group = parser.add_argument_group("a mission from a sentence")
    group.add_argument("--from", dest="sentence", metavar="SENTENCE", help="the mission in a sentence")
    group.add_argument("--model", metavar="NAME", help="the chat model; without it the prompt is written to a file")
    group.add_argument("--model-arg", metavar="K=V", action="append", default=[], help="an option of the model")
    group.add_argument("--rounds", metavar="N", default="6", help="most answers of the model (default 6)")
    group.add_argument("--max-cost", metavar="USD", help="the greatest cost of all calls")
    group.add_argument("--max-tokens", metavar="N", help="the greatest number of tokens of all calls")
    group.add_argument("-j", "--jobs", metavar="N", default="1", help="play N episodes at a time")


def write_from_sentence(args: argparse.Namespace, target: Path) -> int:
    """Write the mission, or without a model its prompt. Exit codes: 0 the mission holds, 1 the last draft does not,
    3 the service or an episode failed.
    """
    sentence = " ".join(args.sentence.split())
    if not sentence or len(sentence) > _LONGEST:
        raise UsageError("--from takes a sentence", hint='for example --from "two drones find a lost hiker"')
    if target.exists():
        raise UsageError(f"`{target}` already exists", hint="nothing is overwritten: choose another name")
    if args.model is None:
        return _write_prompt(sentence, target.with_suffix(".prompt.md"))
    rounds, jobs = whole_number(args.rounds, MOST_ROUNDS) or 0, whole_number(args.jobs, 9999) or 0
    if rounds < 1 or jobs < 1:
        hint = f"--rounds takes 1 to {MOST_ROUNDS}"
        raise UsageError(f"--rounds {args.rounds} -j {args.jobs}: both must be at least 1", hint=hint)
    check_output(str(target))
    return _write_with_model(sentence, target, _writer(args), rounds, jobs)


def _write_prompt(sentence: str, target: Path) -> int:
    from lingjing.authoring.drafting import prompt

    if target.exists():
        raise UsageError(f"`{target}` already exists", hint="nothing is overwritten: choose another name")
    system, user = prompt(sentence)
    write_whole(str(target), f"{system.text}\n{user.text}\n")
    mission = target.name.removesuffix(".prompt.md") + ".ljs"
    print(f"wrote {target}")
    print(f"give it to a chat model, save the answer as {mission}, then: lingjing validate {mission}")
    print(f"test it: lingjing test {mission}")
    return ExitCode.OK


def _writer(args: argparse.Namespace) -> MissionWriter:
    from lingjing.play.spending import CountedCalls, SpendingLimits
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    max_cost = parse_amount("--max-cost", args.max_cost)
    max_tokens = parse_amount("--max-tokens", args.max_tokens, whole=True)
    model = host.models.get(args.model)
    if model is not None and (model.price_in or model.price_out) and max_cost is None:
        raise UsageError(f"calls of `{args.model}` cost money", hint="set a limit with --max-cost USD")
    options = {"model": args.model, **parse_pairs("--model-arg", args.model_arg)}
    limits = SpendingLimits(max_cost, None if max_tokens is None else int(max_tokens))
    return host.writer(WRITER).factory(options, CountedCalls(limits))


def _write_with_model(sentence: str, target: Path, writer: MissionWriter, rounds: int, jobs: int) -> int:
    from lingjing.authoring.drafting import draft, draft_file
    from lingjing.authoring.running import CheckRunner

    held: list[DraftRound] = []

    def tell(this: DraftRound) -> None:
        held.append(this)
        say(f"round {this.number} of {rounds}: {this.summary}")

    try:
        with ending_at_second_interrupt(), results_alone(), CheckRunner(jobs) as runner:
            result = draft(sentence, writer, rounds, runner, tell)
    except (InfrastructureError, KeyboardInterrupt):
        text = next((each.text for each in reversed(held) if each.text), "")
        if text:
            write_whole(str(draft_file(target)), text)
            say(f"the last draft is {draft_file(target)}")
        raise
    if result.is_certified:
        write_whole(str(target), result.text)
        print(f"wrote {target}, after {_answers(len(result.rounds))}: it validates and its expectations hold")
        print(f"play it: lingjing run {target} --policy oracle")
        return ExitCode.OK
    return _report_failure(result, draft_file(target))


def _report_failure(result: Draft, place: Path) -> int:
    last = result.rounds[-1]
    say(f"error: after {_answers(len(result.rounds))} no mission holds; the last: {last.summary}")
    say("hint: a larger --rounds, another --model, or a sentence with numbers and places may help")
    if result.text:
        write_whole(str(place), result.text)
        print(f"wrote {place}, the last draft")
        print(last.problem)
    return ExitCode.MISSION


def _answers(number: int) -> str:
    return f"{number} answer{'s' * (number != 1)}"
