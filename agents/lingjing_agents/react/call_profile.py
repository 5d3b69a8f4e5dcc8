"""The model calls of one episode, reckoned from a measured episode of its column.

`call_profiles.json` holds what `benchmarks/call_profiles.py` has measured: for each role of each column its calls, the
parts of their texts and their pictures. `estimate_calls` turns it into the calls, tokens and price of an episode under
the options of `react`. A mission without a profile is reckoned with the means of all columns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.calls import CallEstimate, CallSum, EpisodeShape
from lingjing_agents.llm.models import ServiceEntry
from lingjing_agents.llm.options import ModelProfile
from lingjing_agents.llm.picture_tokens import FULL_PICTURE, Size
from lingjing_agents.react.options import ReactOptions
from lingjing_agents.react.prompt_files import prompt_text
from lingjing_agents.react.token_bound import token_bound

PROFILES = Path(__file__).with_name("call_profiles.json")
"""The measured episodes, by the name of the column."""

TEXT_SHARE = 0.8
"""Tokens of a text for each token of its bound. Measured over the recorded texts of the profiles: 0.75 to 0.78 with
o200k, 0.77 to 0.84 with a tokenizer that counts each digit, as Qwen's; answers 0.80 to 0.86."""

MEASURED_PROMPT = "P1"
"""The prompt of the measured episodes."""


class RoleProfile(msgspec.Struct, frozen=True, kw_only=True):
    """The calls of all agents of one role in a measured episode. Texts are counted in tokens of the bound
    (`token_bound`)."""

    role: str
    agents: int
    calls: int
    schema: int
    """Tokens of the schema in one system text."""
    system: int
    """Tokens of the system texts of all calls."""
    history: int
    """Tokens of the earlier turns of all calls."""
    state: int
    """Tokens of the states of all calls."""
    late_calls: int
    """The last third of the calls: with full histories."""
    late_history: int
    late_state: int
    repeated: int
    """Tokens of the beginnings that requests share with the ones before."""
    answer: int
    """Tokens of all answers."""
    pictures: dict[str, int]
    """Number of sent pictures by size, such as `1920x1080`."""


class ColumnProfile(msgspec.Struct, frozen=True, kw_only=True):
    """One measured episode."""

    tier: int
    seed: int
    ticks: int
    """Ticks that were played."""
    budget: int
    """Ticks that the mission allows."""
    cpu_s: float
    """CPU seconds of all processes of the episode and of the server that stood for the model."""
    roles: tuple[RoleProfile, ...]


@dataclass(frozen=True, slots=True)
class _Request:
    """The mean request of a role."""

    text: float
    """Tokens of the text."""
    pictures: float
    """Tokens of the pictures."""
    repeated: float
    """Tokens that the service has read before."""
    answer: float

    @property
    def prompt(self) -> float:
        """Tokens of the whole request."""
        return self.text + self.pictures


@cache
def profiles() -> dict[str, ColumnProfile]:
    """Return the measured episodes by column."""
    return from_json(PROFILES.read_bytes(), dict[str, ColumnProfile])


def estimate_calls(options: ReactOptions, shape: EpisodeShape) -> CallEstimate:
    """Return the model calls of an episode under the options."""
    own = profiles().get(f"{shape.mission}-{shape.mode}")
    column = own or _mean_column()
    share = column.ticks / column.budget
    if options.decider != "model":
        return CallEstimate(ticks=share * shape.ticks, work_s=column.cpu_s, measured=own is not None)
    profile = options.profile
    roles = {role.role: role for role in column.roles}
    usual, full = CallSum(cost_usd=0.0), CallSum(cost_usd=0.0)
    for name, agents in shape.roles.items():
        role = roles.get(name) or _mean_role(column.roles)
        # calls of one agent at one tick: fewer than 1 where a search has ended, which is unknown of other missions
        a_tick = 1.0 if own is None else role.calls / (role.agents * column.ticks)
        early, late = _mean_request(role, options, profile), _mean_request(role, options, profile, late=True)
        played = a_tick * agents * share * shape.ticks
        rest = a_tick * agents * (1.0 - share) * shape.ticks
        usual = _sum(usual, _calls(played, early, profile))
        full = _sum(full, _calls(played, early, profile), _calls(rest, late, profile))
    return CallEstimate(
        usual=usual,
        full=full,
        most=_most(options, profile, shape, column.roles),
        ticks=share * shape.ticks,
        work_s=column.cpu_s,
        measured=own is not None,
    )


def _mean_request(role: RoleProfile, options: ReactOptions, profile: ModelProfile, *, late: bool = False) -> _Request:
    calls = role.late_calls if late else role.calls
    history = (role.late_history if late else role.history) / calls
    if options.history_tokens is not None:
        history = min(history, options.history_tokens)
    state = (role.late_state if late else role.state) / calls
    system = role.system / role.calls + _prompt_difference(options, role)
    room = options.request_tokens - options.max_tokens - system - state
    text = TEXT_SHARE * (system + state + max(0.0, min(history, room)))
    pictures = 0.0
    if profile.traits.images:
        sizes = {_size(size): count / role.calls for size, count in role.pictures.items()}
        shown = sum(sizes.values())
        fit = min(1.0, options.images / shown) if shown else 0.0
        each = 1 if options.tiles == 1 else 1 + options.tiles**2
        pictures = fit * each * sum(count * profile.pictures.count(size) for size, count in sizes.items())
    repeated = TEXT_SHARE * min(role.repeated / role.calls, system + max(0.0, min(history, room)))
    answer = min(TEXT_SHARE * role.answer / role.calls, options.max_tokens)
    return _Request(text, pictures, _cached(profile.service, repeated), answer)


def _prompt_difference(options: ReactOptions, role: RoleProfile) -> int:
    """Return the tokens by which the options' prompt differs from the measured one."""
    if options.prompt == MEASURED_PROMPT:
        return 0
    prompt, measured = prompt_text(options.prompt), prompt_text(MEASURED_PROMPT)
    without_schema = 0 if prompt.has_schema else role.schema
    return token_bound(prompt.text) - token_bound(measured.text) - without_schema


def _cached(service: ServiceEntry, tokens: float) -> float:
    """Return the tokens of a repeated beginning that the service bills as cached."""
    if service.cache_from is None or tokens < service.cache_from:
        return 0.0
    return tokens - tokens % service.cache_step


def _calls(number: float, request: _Request, profile: ModelProfile) -> CallSum:
    return CallSum(
        calls=number,
        prompt_tokens=number * request.prompt,
        cached_tokens=number * request.repeated,
        completion_tokens=number * request.answer,
        cost_usd=profile.traits.cost_usd(
            round(number * request.prompt), round(number * request.answer), round(number * request.repeated)
        ),
    )


def _most(options: ReactOptions, profile: ModelProfile, shape: EpisodeShape, roles: Iterable[RoleProfile]) -> CallSum:
    """Return the upper bound: each agent is asked at each tick, with all repairs and crops, a full request and the
    longest answer."""
    calls = sum(shape.roles.values()) * shape.ticks * (1 + options.repairs + options.crops)
    images = options.images * (1 if options.tiles == 1 else 1 + options.tiles**2) if profile.traits.images else 0
    shortest = max(role.system / role.calls + role.late_state / role.late_calls for role in roles)
    whole = shortest + images * profile.pictures.count(FULL_PICTURE)  # is sent even if it exceeds the budget
    prompt, answer = max(options.request_tokens - options.max_tokens, round(whole)), options.max_tokens
    return CallSum(
        calls=calls, prompt_tokens=calls * prompt, completion_tokens=calls * answer,
        cost_usd=profile.traits.cost_usd(calls * prompt, calls * answer),
    )  # fmt: skip


def _sum(*parts: CallSum) -> CallSum:
    """Return the sum; its price is unknown if one of the parts is."""
    prices = [part.cost_usd for part in parts]
    known = [price for price in prices if price is not None]
    return CallSum(
        calls=sum(part.calls for part in parts),
        prompt_tokens=sum(part.prompt_tokens for part in parts),
        cached_tokens=sum(part.cached_tokens for part in parts),
        completion_tokens=sum(part.completion_tokens for part in parts),
        cost_usd=sum(known) if len(known) == len(prices) else None,
    )


@cache
def _mean_column() -> ColumnProfile:
    """Return a column with the means of all measured ones; the roles are one."""
    columns = profiles().values()
    role = _mean_role([role for column in columns for role in column.roles])
    ticks, budget = (sum(getattr(column, name) for column in columns) for name in ("ticks", "budget"))
    cpu_s = sum(column.cpu_s for column in columns) / len(columns)
    return ColumnProfile(tier=0, seed=0, ticks=ticks, budget=budget, cpu_s=round(cpu_s, 1), roles=(role,))


def _mean_role(roles: Sequence[RoleProfile]) -> RoleProfile:
    """Return one role with the sums of several."""
    names = [name for name in RoleProfile.__struct_fields__ if name not in ("role", "schema", "pictures")]
    sums = {name: sum(getattr(role, name) for role in roles) for name in names}
    pictures = Counter[str]()
    for role in roles:
        pictures.update(role.pictures)
    schema = round(sum(role.schema * role.calls for role in roles) / sums["calls"])
    return RoleProfile(role="", schema=schema, pictures=dict(pictures), **sums)


def _size(text: str) -> Size:
    width, _, height = text.partition("x")
    return int(width), int(height)
