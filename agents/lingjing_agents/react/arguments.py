"""`--policy-arg` values of `react`: what it is played with, and the client that they ask for."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace

from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.address import Address, address
from lingjing_agents.llm.capabilities import Capability, capability_of
from lingjing_agents.llm.chat import ModelClient
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.guard import GuardedClient
from lingjing_agents.llm.redaction import Redactor
from lingjing_agents.llm.through_litellm import LitellmClient, load_litellm
from lingjing_agents.options import choice, number, whole

_KEY_VARIABLES = ("_API_KEY", "_ACCESS_KEY", "_API_TOKEN", "_ACCESS_TOKEN", "_AUTH_TOKEN")
_LEAST_KEY_LETTERS = 16
_ADDRESS_HINT = "for instance --policy-arg base_url=http://localhost:8000/v1"


@dataclass(frozen=True, slots=True)
class Options:
    """The policy's checked arguments; `price_*` in US dollars per million tokens, None where not given."""

    model: str
    capability: Capability
    temperature: float | None
    insist: bool
    max_tokens: int
    deadline_s: float
    repairs: int
    tries: int
    history: int
    image_side: int
    images: int
    price_in: float | None
    price_out: float | None


def read_options(given: dict[str, str]) -> Options:
    """The policy's arguments, checked. Raises `UsageError` for each that is wrong."""
    model = given.get("model", "")
    if not model:
        raise UsageError("policy `react` needs a model", hint="give --policy-arg model=NAME")
    known = capability_of(model)
    capability = replace(
        known,
        vision=_switch("vision", given, default=known.vision),
        json_schema=_switch("schema", given, default=known.json_schema),
    )
    insist = "temperature" in given
    temperature = number("temperature", given.get("temperature", "0"), 0.0, 2.0)
    return Options(
        model=model,
        capability=capability,
        temperature=temperature if insist or capability.temperature else None,
        insist=insist,
        max_tokens=whole("max_tokens", given.get("max_tokens", "2048"), 16, 1_000_000),
        deadline_s=number("deadline", given.get("deadline", "80"), 0.1, 86_400.0),
        repairs=whole("repairs", given.get("repairs", "2"), 0, 10),
        tries=whole("tries", given.get("tries", "5"), 1, 20),
        history=whole("history", given.get("history", "6"), 0, 1000),
        image_side=whole("image_side", given.get("image_side", "1280"), 64, 8192),
        images=whole("images", given.get("images", "2"), 0, 16),
        price_in=_price("price_in", given),
        price_out=_price("price_out", given),
    )


def make_client(given: dict[str, str]) -> ModelClient:
    """The client the arguments ask for, behind a guard that knows its secrets. Arguments go into the trace, so a key
    and an address with a password in it are named by their environment variables."""
    key = _from_environment("api_key_env", given)
    service = _service(given)
    if choice("client", given.get("client", "direct"), ("direct", "litellm")) == "litellm":
        load_litellm()  # seconds of import: before the first barrier, and a missing package is told at once
        secrets = (key, *service.secrets, *_keys_of_environment())
        return GuardedClient(LitellmClient(service.url, key, service.login), Redactor(secrets))
    if not service.url:
        raise UsageError("client=direct needs the service's address", hint=_ADDRESS_HINT)
    return GuardedClient(DirectClient(service.url, key, service.login), Redactor((key, *service.secrets)))


def _service(given: dict[str, str]) -> Address:
    """The service's address: given, or named by its environment variable; an empty one if there is none."""
    named = _from_environment("base_url_env", given)
    url = given.get("base_url", "")
    if url and named:
        raise UsageError("base_url and base_url_env are both given", hint="leave one of them out")
    if not url and not named:
        return Address("")
    try:
        service = address(url or named)
    except ValueError as error:
        raise UsageError(f"base_url is not a service's address: {error}", hint=_ADDRESS_HINT) from error
    if url and service.login:
        raise UsageError(
            "base_url holds a user or password, and arguments are written into the trace",
            hint="export the address in a variable and give base_url_env=VARIABLE; a bearer key goes by api_key_env",
        )
    return service


def _from_environment(argument: str, given: dict[str, str]) -> str:
    """The value of the environment variable that an argument names, or an empty text if it names none."""
    name = given.get(argument, "")
    value = os.environ.get(name, "")
    if name and not value:
        shown = name if re.fullmatch(r"[A-Z][A-Z0-9_]{0,63}", name) else "…"  # it may be the key itself
        raise UsageError(
            f"{argument}={shown}: that environment variable is not set",
            hint=f"{argument} takes the name of a variable: export NAME=…, then {argument}=NAME",
        )
    return value


def _keys_of_environment() -> tuple[str, ...]:
    """The keys that litellm may find for itself."""
    return tuple(
        value
        for name, value in sorted(os.environ.items())
        if name.endswith(_KEY_VARIABLES) and len(value) >= _LEAST_KEY_LETTERS
    )


def _switch(name: str, given: dict[str, str], *, default: bool) -> bool:
    value = choice(name, given.get(name, "auto"), ("auto", "yes", "no"))
    return default if value == "auto" else value == "yes"


def _price(name: str, given: dict[str, str]) -> float | None:
    return number(name, given[name], 0.0, 1e6) if name in given else None
