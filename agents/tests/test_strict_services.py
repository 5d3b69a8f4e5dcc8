"""A service with constrained decoding, on loopback: random answers within the schema that `react` sends are steps.

llguidance is the library behind the structured answers of several servers. It decodes byte by byte at random, so that
whatever the schema admits comes up. `pip install llguidance`.
"""

from __future__ import annotations

import json
import random
from typing import Any

import pytest

from agents.tests.agent_kit import Inbox, brief, observe, react
from agents.tests.chat_server import Reply, serve
from lingjing.plugins.policy import NoDecisionError

llguidance = pytest.importorskip("llguidance", reason="llguidance is not installed: pip install llguidance")

ANSWERS = 40
MOST_BYTES = 8000


class ConstrainedModel:
    """A model that writes random bytes which the schema of the request admits."""

    def __init__(self) -> None:
        self._tokenizer = llguidance.LLTokenizer("byte")
        self._random = random.Random(1)

    def __call__(self, request: dict[str, Any]) -> Reply:
        schema = request["response_format"]["json_schema"]["schema"]
        compiled = llguidance.LLMatcher.grammar_from_json_schema(json.dumps(schema), {"whitespace_flexible": False})
        error, warnings = llguidance.LLMatcher.validate_grammar_with_warnings(compiled, self._tokenizer)
        assert not error and not warnings, "every keyword of the schema is enforced"
        return Reply(self._written(llguidance.LLMatcher(self._tokenizer, compiled)))

    def _written(self, matcher: Any) -> str:
        written = bytearray()
        while len(written) < MOST_BYTES and not matcher.is_stopped():
            if matcher.is_accepting() and self._random.random() < 0.9:
                break
            mask = matcher.compute_bitmask()
            admitted = [byte for byte in range(256) if mask[byte // 8] >> byte % 8 & 1]
            closing = [byte for byte in admitted if byte in b'"]},']  # so that texts and lists end
            plain = [byte for byte in admitted if 32 <= byte < 127] or admitted
            byte = self._random.choice(closing if closing and self._random.random() < 0.5 else plain)
            matcher.consume_token(byte)
            written.append(byte)
        return written.decode()


async def test_every_answer_within_the_schema_is_a_step_or_has_a_box_with_disordered_edges() -> None:
    used, faults = 0, []
    with serve(ConstrainedModel()) as server:
        policy = react(model="m", base_url=server.url, repairs="0")
        await policy.reset(brief("scout[1]"))
        for tick in range(ANSWERS):
            try:
                await policy.act(observe("scout[1]", tick), Inbox())
                used += 1
            except NoDecisionError as error:
                faults.append(str(error))
    assert used >= ANSWERS // 2
    assert all("x_min, y_min, x_max, y_max with min < max are due" in fault for fault in faults), faults


async def test_strict_mode_is_off_because_the_schema_has_optional_fields() -> None:
    """OpenAI's `strict` takes only schemas with all fields required: so the flag is sent as false."""
    with serve([Reply()]) as server:
        policy = react(model="m", base_url=server.url)
        await policy.reset(brief("scout[1]"))
        await policy.act(observe("scout[1]", 0), Inbox())
    (request,) = server.requests
    sent = request["response_format"]["json_schema"]
    assert sent["strict"] is False
    assert set(sent["schema"]["properties"]) > set(sent["schema"]["required"])
