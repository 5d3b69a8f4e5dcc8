"""Tests that no text of a service, a library or an exception carries a key or a password out of a client."""

import html
import json
import logging
import os
import re
import sys
import traceback
from base64 import b64encode
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote, unquote

import pytest
from lingjing_agents.llm.redaction import RUN, Redactor
from lingjing_agents.react.policy import PATIENCE

from agents.tests.agent_kit import Inbox, brief, observe, react
from agents.tests.hostile_server import answered, completion, header_of, serve_raw
from lingjing.plugins.policy import InfrastructureError, NoDecisionError, UsageError
from lingjing.testing.traces import scan
from tools.python_forks import run_python

KEY = 'Zq8vT3kX9-mWn2bLs/7"Rü'
PASSWORD = "hUn7er42 &co"
LOGIN = f"planner:{PASSWORD}"
MISSION = """\
ljs 1
use std.sea { lifeboat, person_in_water }
mission trip "A short trip" {
  goal "Bring the boat to the swimmer."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 60, policy <= 600 s }
  asset boat : lifeboat { position = (12.4 m, -1351.8 m), actions { moveTo } }
  target swimmer : person_in_water { position = (12.4 m, -1200 m) }
  agent skipper as rescuer controls boat { observes boat.*, swimmer.position, events }
  success when distance_xy(boat, swimmer) <= 10 m
}
"""

SPELLINGS: dict[str, Callable[[str], str]] = {
    "plain": str,
    "lower case": str.lower,
    "upper case": str.upper,
    "bearer": lambda key: f"Bearer {key}",
    "percent": lambda key: quote(key, safe=""),
    "every letter in percent": lambda key: "".join(f"%{byte:02x}" for byte in key.encode()),
    "percent twice": lambda key: quote(quote(key, safe=""), safe=""),
    "json": json.dumps,
    "every letter in json": lambda key: "".join(f"\\u{ord(letter):04x}" for letter in key),
    "html": html.escape,
    "json in json": lambda key: json.dumps(json.dumps("".join(f"\\u{ord(letter):04x}" for letter in key))),
    "every letter in html": lambda key: "".join(f"&#{ord(letter)};" for letter in key),
    "hexadecimal": lambda key: key.encode().hex(),
    "base64": lambda key: b64encode(key.encode()).decode(),
    "base64 of more": lambda key: b64encode(f"Bearer {key} of yours".encode()).decode(),
    "the first half": lambda key: f"{key[: len(key) // 2]}…",
    "the last half": lambda key: f"…{key[len(key) // 2 :]}",
    "in a url": lambda key: f"https://{quote(key)}@host/v1",
    "twice": lambda key: f"{key} and {key}",
    "at the cut": lambda key: "x" * 230 + key,
}


def readable(text: str) -> Iterator[str]:
    """Yield the text with its escapes undone, step by step, as a search for keys would read it."""
    for _ in range(3):
        text = re.sub(r"\\+u([0-9a-f]{4})", lambda match: chr(int(match[1], 16)), html.unescape(unquote(text)))
        yield text.lower()


def disclosed(text: str, secret: str, run: int = RUN + 2) -> str:
    """Return a substring of the secret that a text contains in any encoding; "" if there is none."""
    data, views = secret.encode(), list(readable(text))
    forms = [secret.lower(), data.hex(), *(b64encode(b"?" * at + data).decode()[4:-4].lower() for at in range(3))]
    for form in forms:
        for at in range(max(1, len(form) - run + 1)):
            if any(form[at : at + run] in view for view in views):
                return form[at : at + run]
    return ""


@pytest.mark.parametrize("secret", [KEY, LOGIN, "sk-proj-0123456789abcdef", "correct horse battery staple"])
@pytest.mark.parametrize("spelling", SPELLINGS)
def test_a_secret_is_redacted_in_every_spelling(spelling: str, secret: str):
    text = f"you sent {SPELLINGS[spelling](secret)} to us"
    redacted = Redactor((secret,))(text)
    assert not disclosed(redacted, secret)
    assert redacted.startswith("you sent ")
    assert redacted.endswith(" to us")


def test_short_secrets_are_redacted_only_as_whole_words_and_very_short_ones_never():
    assert Redactor(("EMPTY",))("the key EMPTY is not EMPTYING") == "the key *** is not EMPTYING"
    assert Redactor(("x", ""))('{"x": 1}') == '{"x": 1}'
    assert Redactor(())("http://me:pw@host") == "http://***@host"


def test_texts_without_secrets_are_not_changed():
    redact = Redactor((KEY, LOGIN))
    for text in (json.dumps({"thought": "100 % sure, a&amp;b \\u00e9 %41", "x": [1, 2]}), "", "İstanbul" * 1000):
        assert redact(text) == text


@pytest.mark.parametrize(
    "piece", ["x", "%41", "&#65;", "\\u0041", "\\", "%", "&", "://", "://a", "Zq8vT3kX", "é", "%25", "@"]
)
def test_a_long_answer_is_searched_in_linear_time(piece: str):
    """A search with quadratic cost would take an hour and exceed the suite's time limit."""
    key = "Zq8vT3kX9-mWn2bLs77Rx"
    redacted = Redactor((key, LOGIN))(piece * (500_000 // len(piece)) + f" {key} {quote(KEY)} {key[:12]}")
    assert not disclosed(redacted[-200:], key)


def echo(status: str, spell: Callable[[str], str]):
    """A service that returns the authorisation that it received."""

    def answer(request: bytes) -> Iterator[bytes]:
        sent = header_of(request, "authorization").partition(" ")[2]
        body = json.dumps({"error": {"message": f"wrong key: {spell(sent)}"}}, ensure_ascii=False).encode()
        yield answered(status, body, f"x-your-key: {quote(sent)}", "content-type: application/json")

    return answer


def client_arguments(client: str) -> dict[str, str]:
    if client == "litellm" and find_spec("litellm") is None:
        pytest.skip("litellm is an optional extra")
    return {"client": client, "model": "openai/m" if client == "litellm" else "m"}


async def test_exceptions_their_causes_and_logs_hold_no_key(monkeypatch, caplog, capfd):
    """`test_llm_bounds.py` has this test through litellm."""
    await check_that_no_exception_or_log_holds_the_key("direct", monkeypatch, caplog, capfd)


async def check_that_no_exception_or_log_holds_the_key(client, monkeypatch, caplog, capfd):
    key = KEY.encode("ascii", "ignore").decode()
    monkeypatch.setenv("SERVICE_KEY", key)
    caplog.set_level(logging.DEBUG)
    with serve_raw(echo("401 Unauthorized", str)) as url:
        policy = react(base_url=url, api_key_env="SERVICE_KEY", deadline="600", **client_arguments(client))
        await policy.reset(brief("scout[1]"))
        for tick in range(PATIENCE):
            with pytest.raises((NoDecisionError, InfrastructureError)) as failure:
                await policy.act(observe("scout[1]", tick), Inbox())
    report = "".join(traceback.TracebackException.from_exception(failure.value, capture_locals=False).format())
    assert "wrong key" in report
    for text in (report, _linked(failure.value), caplog.text, *capfd.readouterr()):
        assert not disclosed(text, key)
    assert caplog.records


def _linked(error: BaseException) -> str:
    """Return an exception with all linked exceptions and their attributes."""
    seen, texts, waiting = set(), [], [error]
    while waiting:
        error = waiting.pop()
        if id(error) not in seen:
            seen.add(id(error))
            texts.append(f"{error!r} {vars(error)}")
            waiting += [linked for linked in (error.__cause__, error.__context__) if linked is not None]
    return "\n".join(texts)


async def test_a_key_in_the_answer_of_a_model_is_redacted(monkeypatch):
    key = "Zq8vT3kX9-mWn2bLs77Rx"
    monkeypatch.setenv("SERVICE_KEY", key)
    step = {"thought": f"my key is {key}", "command": None, "messages": []}
    with serve_raw(lambda request: iter([completion(json.dumps(step))])) as url:
        policy = react(model="m", base_url=url, api_key_env="SERVICE_KEY")
        await policy.reset(brief("scout[1]"))
        assert (await policy.act(observe("scout[1]", 1), Inbox())).thought == "my key is ***"


async def test_a_login_from_the_environment_is_sent_and_not_disclosed(monkeypatch):
    with serve_raw(echo("403 Forbidden", str)) as url:
        monkeypatch.setenv("SERVICE_URL", url.replace("//", f"//{quote(LOGIN, safe=':')}@"))
        policy = react(model="m", base_url_env="SERVICE_URL")
        await policy.reset(brief("scout[1]"))
        with pytest.raises(NoDecisionError, match="wrong key") as failure:
            await policy.act(observe("scout[1]", 1), Inbox())
    for secret in (LOGIN, PASSWORD):
        assert not disclosed(str(failure.value), secret)
        assert not disclosed(repr(vars(policy)), secret)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"base_url": f"http://planner:{quote(PASSWORD)}@localhost/v1"}, "base_url_env"),
        ({"base_url": f"http://{quote(PASSWORD)}@localhost/v1"}, "base_url_env"),
        ({"base_url": f"planner:{PASSWORD}@localhost/v1"}, "http://localhost"),
        ({"base_url": f"ftp://planner:{PASSWORD}@localhost/v1"}, "http://localhost"),
        ({"base_url": f"http://localhost/v1?key={quote(PASSWORD)}"}, "query"),
        ({"base_url": f"http://[{PASSWORD}]/v1"}, "http://localhost"),
        ({"base_url": f"http://localhost:{PASSWORD}/v1"}, "http://localhost"),
        (
            {"base_url": "http://localhost/v1", "api_key_env": f"{PASSWORD}"},
            "takes the name of an environment variable",
        ),
        ({"base_url_env": "NO_SUCH_URL"}, "NO_SUCH_URL"),
    ],
)
def test_secrets_in_arguments_are_rejected_and_not_repeated(arguments: dict[str, str], says: str):
    with pytest.raises(UsageError) as failure:
        react(model="m", **arguments)
    assert says in f"{failure.value} {failure.value.hint}"
    assert not disclosed(f"{failure.value} {failure.value.hint} {_linked(failure.value)}", PASSWORD, 7)


@pytest.mark.parametrize("client", ["direct", pytest.param("litellm", marks=pytest.mark.thorough)])
def test_a_run_with_a_service_that_echoes_its_key_leaves_no_key_in_its_output(client: str, tmp_path: Path):
    key = "Zq8vT3kX9-mWn2bLs77Rx"
    (tmp_path / "trip.ljs").write_text(MISSION)
    spellings = iter(list(SPELLINGS.values()) * 100)
    with serve_raw(lambda request: echo("401 Unauthorized", next(spellings))(request)) as url:
        arguments = {"base_url": url, "api_key_env": "SERVICE_KEY", **client_arguments(client)}
        pairs = [part for name, value in arguments.items() for part in ("--policy-arg", f"{name}={value}")]
        done = run_python(
            [
                *(sys.executable, "-m", "lingjing.cli.main", "run", "trip.ljs"),
                *("--policy", "react", *pairs, "-o", "run", "--json", "--no-overview"),
            ],
            cwd=tmp_path,
            env={**os.environ, "SERVICE_KEY": key, "LINGJING_TRACEBACK": "1"},
            timeout=1500.0,
        )
    assert done.returncode == 3, done.stderr
    report = json.loads(done.stdout)
    assert report["metrics"]["calls"] > 0
    assert report["reason"] == "infrastructure-abort"
    assert "wrong key" in report["detail"]
    assert "hint: another key" in done.stderr
    left = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert left
    stored = [stored.data for path in left if path.suffix == ".part" for stored in scan(path)]
    assert stored
    for text in (done.stdout, done.stderr, *(path.read_bytes().decode("latin-1") for path in left)):
        assert not disclosed(text, key)
    for data in stored:
        assert not disclosed(data.decode("latin-1"), key)
