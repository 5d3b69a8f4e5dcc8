"""What a model can do, by its name: an own small table, because the services' own tables are wrong for local models.

The first pattern that matches (shell style, case ignored, provider prefixes cut) decides. `vision=` and `schema=`
of the policy override it. An unknown model is taken to see and to follow a JSON Schema: a service that cannot says so
with status 400, and `react` then names the argument to set.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from lingjing_agents.llm.chat import TokenLimit


@dataclass(frozen=True, slots=True)
class Capability:
    """Whether a model takes images, whether its service honours `response_format: json_schema`, whether it takes a
    temperature, and what it calls the bound on an answer's tokens."""

    vision: bool = True
    json_schema: bool = True
    temperature: bool = True
    limit_name: TokenLimit = "max_tokens"


_REASONING = Capability(temperature=False, limit_name="max_completion_tokens")
_TEXT_ONLY = Capability(vision=False)
_PLAIN = Capability(vision=False, json_schema=False)

TABLE: tuple[tuple[str, Capability], ...] = (
    ("gpt-3.5*", _PLAIN),
    ("o1-mini*", replace(_REASONING, vision=False, json_schema=False)),
    ("o3-mini*", replace(_REASONING, vision=False)),
    ("o[134]", _REASONING),
    ("o[134]-*", _REASONING),
    ("gpt-5*chat*", Capability(limit_name="max_completion_tokens")),
    ("gpt-5*", _REASONING),
    ("gpt-oss*", _TEXT_ONLY),
    ("deepseek-*", Capability(vision=False, json_schema=False)),
    ("smollm*", _TEXT_ONLY),
    ("gemma-3-1b*", _TEXT_ONLY),
    ("llama-3.[13]*", _TEXT_ONLY),
    ("mistral-7b*", _TEXT_ONLY),
    ("qwen*coder*", _TEXT_ONLY),
    ("qwen2.5-[0-9]*", _TEXT_ONLY),
    ("qwen3-[0-9]*", _TEXT_ONLY),
)


def capability_of(model: str) -> Capability:
    """The capability of `model`, for instance `hosted_vllm/Qwen/Qwen3-VL-8B-Instruct`."""
    name = model.rsplit("/", 1)[-1].lower()
    return next((capability for pattern, capability in TABLE if fnmatchcase(name, pattern)), Capability())
