"""The card of a frame set: what it holds, how it was chosen, and what it does not say."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence

from lingjing.bench.dataset_card import PAPER, seed_ranges
from lingjing.bench.exports import escape_markdown
from lingjing.bench.frame_sets.balance import SPLITS, ClassSet


def frame_card(sets: Sequence[ClassSet], about: str = "") -> str:
    """The card in Markdown, with the head that dataset hubs read."""
    return "\n".join([*_head(sets), *_counts(sets, about), *_chosen(), *_limits()]) + "\n"


def _head(sets: Sequence[ClassSet]) -> Iterator[str]:
    size = sum(len(one.frames) for one in sets)
    yield "---"
    yield 'pretty_name: "Lingjing frames"'
    yield "task_categories: [object-detection, image-classification]"
    yield "tags: [simulation, aerial-imagery, hard-negatives]"
    yield f"size_categories: [{'n<1K' if size < 1000 else '1K<n<10K' if size < 10000 else '10K<n<100K'}]"
    yield "configs:"
    for one in sets:
        yield f"- config_name: {json.dumps(one.cls)}"
        yield "  data_files:"
        for split in SPLITS:
            if any(each.split == split for each in one.frames):
                yield f"  - {{split: {split}, path: {json.dumps(f'{one.cls}/{split}/**')}}}"
    yield "---"
    yield "\n# Lingjing frames\n"


def _counts(sets: Sequence[ClassSet], about: str) -> Iterator[str]:
    if about:
        yield f"{escape_markdown(' '.join(about.split()))}\n"
    yield f"Frames of simulated cameras from episodes of missions in simulated cities, as specified in *{PAPER}*.\n"
    yield "| class | split | with a target | without | of these hard | boxes | missions | seeds |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | --- | --- |"
    for one in sets:
        for split in SPLITS:
            mine = [each for each in one.frames if each.split == split]
            boxes = sum(len(each.frame.shows(one.cls)) for each in mine)
            missions = ", ".join(sorted({each.frame.mission for each in mine})) or "–"
            hard = Counter(each.hard for each in mine if each.hard)
            told = ", ".join(f"{number} {name}" for name, number in sorted(hard.items())) or "0"
            seeds = seed_ranges({each.frame.seed for each in mine}) or "–"
            yield (
                f"| `{one.cls}` | {split} | {one.count(split, present=True)} | {one.count(split, present=False)} "
                f"| {told} | {boxes} | {missions} | {seeds} |"
            )
    yield ""
    for one in sets:
        yield (
            f"- `{one.cls}`: left out for balance {one.spare_positives} frames with a target and {one.spare_negatives} "
            f"without; {one.faint} because their targets are too faint to be seen"
        )
    policies = sorted({each.frame.policy for one in sets for each in one.frames})
    yield f"- flown by: {escape_markdown(', '.join(policies)) or 'nobody'}"


def _chosen() -> Iterator[str]:
    yield "\n## How frames were chosen\n"
    yield "- A target counts as visible if the engine says so: drawn pixels of its own, and enough contrast (ADR 0012)."
    yield "- As many frames without a target as with one, in each split; seeds of the validation are none of training."
    yield "- Hard negatives come first: `reported` if a policy reported a target that is not there, `other` if another"
    yield "  entity of the mission is in view. Each seed gives one frame in turn."
    yield "- `coco_*.json` is COCO with boxes in pixels, `area` visible pixels; `metadata.jsonl` is for `imagefolder`."


def _limits() -> Iterator[str]:
    yield "\n## What it does not say\n"
    yield "- The frames are where policies flew and what they photographed: no sample of the city."
    yield "- Frames of one episode show the same place from near each other: count episodes, not frames."
    yield "- The pictures are rendered. What is learnt of them need not hold for photographs."


__all__ = ["frame_card"]
