"""What a failed episode looked like to its agents, in some hundred words, for whoever revises a prompt.

It holds what policies were told and did, and counts of what came of it, and nothing that the mission hides.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from lingjing.analysis.metrics import metrics
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, DecisionRecord

FIRST, LAST, LONGEST = 5, 4, 220
"""Decisions of an agent that are told from its beginning and its end; letters of one thought."""

AGENTS = 6


def failed_episode(trace: Trace) -> str:
    """The episode's end, what went wrong by kind, and the first and last decisions of its agents."""
    found = metrics(trace)
    lines = [
        f"It ended after {found.ticks} ticks ({found.reason}); {found.scr or 0.0:.0%} of its subtasks were done.",
        f"Stages: {', '.join(f'{one.name} {one.done} of {one.required}' for one in found.stages) or 'none'}.",
        f"Reports: {found.reports}, {found.detections} of them of a target; {found.misses} targets in view missed.",
        f"Messages: {found.messages}. Rejected: {_counted(trace)}.",
        *_answers(trace),
    ]
    for agent in list(dict.fromkeys(made.agent for record in trace.boundaries for made in record.decisions))[:AGENTS]:
        lines += [f"Agent {agent}:", *_decisions(trace, agent)]
    return "\n".join(lines)


def _counted(trace: Trace) -> str:
    refused = Counter(
        f"{receipt.resource}: {receipt.reason}"
        for record in trace.boundaries
        for receipt in record.receipts
        if receipt.status == "rejected"
    )
    return ", ".join(f"{many} times {what}" for what, many in refused.most_common(6)) or "nothing"


def _answers(trace: Trace) -> Iterator[str]:
    """The answers that could not be used, each kind of fault once."""
    faults = Counter(
        made.detail[:LONGEST] for record in trace.boundaries for made in record.decisions if made.substituted
    )
    for fault, many in faults.most_common(3):
        yield f"{many} answers could not be used: {fault}"


def _decisions(trace: Trace, agent: str) -> Iterator[str]:
    made = [
        (record, decision) for record in trace.boundaries for decision in record.decisions if decision.agent == agent
    ]
    left_out = len(made) - FIRST - LAST
    for record, decision in made[:FIRST]:
        yield _said(record, decision)
    if left_out > 0:
        yield f"  … {left_out} more …"
    for record, decision in made[max(FIRST, len(made) - LAST) :]:
        yield _said(record, decision)


def _said(record: BoundaryRecord, made: DecisionRecord) -> str:
    command, messages = made.decision.command, made.decision.messages
    did = f"{command.verb} {dict(command.arguments)}" if command else "no command"
    sent = f"; sends {', '.join(message.kind for message in messages)}" if messages else ""
    thought = " ".join(made.decision.thought.split())[:LONGEST]
    return f"  tick {record.tick - 1}: {did}{sent}" + (f' ("{thought}")' if thought else "")
