"""The table of models: the paper's models, extensions, rejections, and the resulting requests."""

import json
from pathlib import Path

import pytest
from lingjing_agents.llm.asking import open_model
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.models import read_models
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import CallDeadline

from agents.tests.chat_server import Reply, completion, serve
from lingjing.errors import ExitCode
from lingjing.plugins.backbone import ChatMessage, ChatRequest
from lingjing.plugins.calls import UnrecordedCalls
from lingjing.plugins.options import read_options
from lingjing.plugins.policy import UsageError
from lingjing.testing import PluginHost, run_command

PAPER = [
    "gpt-5.5", "gpt-5.4", "gemini-3.1-pro", "kimi-k2.5", "qwen3-vl-flash", "qwen3-vl-2b", "qwen3-vl-4b", "qwen3-vl-8b",
    "internvl3.5-8b", "pixtral-12b", "minicpm-v-4.5", "gemma-3-4b", "qwen3.7-plus",
]  # fmt: skip
SCHEMA = b'{"type": "object", "properties": {"thought": {"type": "string"}}}'
KEYS = ("OPENAI_API_KEY", "GEMINI_API_KEY", "MOONSHOT_API_KEY", "DASHSCOPE_API_KEY")


@pytest.fixture(autouse=True)
def alone(tmp_path, monkeypatch):
    """Remove the machine's own table and keys from the environment."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    for name in ("LINGJING_MODELS", *KEYS):
        monkeypatch.delenv(name, raising=False)


def options(**values: object) -> ModelOptions:
    return read_options(ModelOptions, values, "policy `test`")


async def sent(url: str, **arguments: object) -> dict[str, object]:
    with serve([Reply()]) as server:
        model = open_model(options(base_url=server.url, **arguments), UnrecordedCalls())
        await model.ask(0, (ChatMessage("user", "hi"),), CallDeadline(20), schema=SCHEMA)
    (request,) = server.requests
    return request


def own_list(folder: Path, text: str) -> str:
    path = folder / "own.toml"
    path.write_text(text)
    return str(path)


def test_the_papers_models_are_listed_in_its_order_with_services_and_prices():
    table = read_models()
    assert list(table.models) == PAPER
    for name in PAPER:
        entry = table.models[name]
        assert table.services[entry.service].base_url.startswith("http"), name
        assert entry.images, name
        assert entry.priced == (name != "qwen3-vl-flash"), name  # no price was published for that model
        assert bool(entry.price_source) == bool(entry.price_in), name
        assert entry.price_source in PluginHost().models[name].summary
        if entry.tier == "open":
            assert (entry.service, entry.context, entry.price_in, entry.price_out) == ("vllm", 16_384, 0.0, 0.0), name
    assert sum(table.models[name].tier == "commercial" for name in PAPER[:12]) == 5


def test_the_plugins_offer_the_papers_models():
    models = PluginHost().models
    assert set(PAPER) <= models.keys()
    assert models["gpt-5.5"].arguments == {"model": "gpt-5.5"}
    assert (models["gpt-5.5"].price_in, models["gpt-5.5"].price_out) == (5.0, 30.0)
    assert models["qwen3-vl-flash"].price_in is None


@pytest.mark.parametrize(
    ("arguments", "present", "absent"),
    [
        (
            {"model": "gpt-5.5"},
            {"model": "gpt-5.5", "max_completion_tokens": 2048, "reasoning_effort": "none", "temperature": 0.0},
            ["max_tokens"],
        ),
        (
            {"model": "gpt-5.5", "reasoning_effort": "high"},
            {"reasoning_effort": "high", "max_completion_tokens": 2048},
            ["temperature", "max_tokens"],
        ),
        ({"model": "gemini-3.1-pro"}, {"reasoning_effort": "low", "max_tokens": 2048, "temperature": 0.0}, []),
        ({"model": "kimi-k2.5"}, {"thinking": {"type": "disabled"}}, ["temperature", "reasoning_effort"]),
        (
            {"model": "qwen3.7-plus"},
            {"enable_thinking": False, "response_format": {"type": "json_object"}, "temperature": 0.0},
            ["tools"],
        ),
        (
            {"model": "minicpm-v-4.5"},
            {"model": "openbmb/MiniCPM-V-4_5", "chat_template_kwargs": {"enable_thinking": False}},
            [],
        ),
        ({"model": "o3"}, {"max_completion_tokens": 2048}, ["temperature", "max_tokens"]),
        ({"model": "mystery", "structured": "none"}, {"max_tokens": 2048}, ["response_format", "tools"]),
    ],
)
async def test_each_model_receives_its_own_parameters(arguments, present, absent):
    request = await sent("", **arguments)
    assert {name: request.get(name) for name in present} == present
    assert not set(absent) & request.keys()


async def test_a_step_is_read_from_the_arguments_of_a_tool_call():
    reply = completion(Reply())
    step = {"thought": "by a tool", "command": None, "messages": []}
    call = {"id": "1", "type": "function", "function": {"name": "step", "arguments": json.dumps(step)}}
    reply["choices"][0]["message"] = {"role": "assistant", "content": None, "tool_calls": [call], "reasoning": "so"}
    with serve([Reply(body=json.dumps(reply))]) as server:
        model = open_model(options(model="m", base_url=server.url, structured="tool"), UnrecordedCalls())
        answer = await model.ask(0, (ChatMessage("user", "hi"),), CallDeadline(20), schema=SCHEMA)
    assert json.loads(answer.text) == step
    assert answer.reasoning == "so"
    (request,) = server.requests
    assert request["tools"][0]["function"]["parameters"] == json.loads(SCHEMA)
    assert request["tool_choice"]["function"]["name"] == "step"


async def test_tool_arguments_that_are_an_object_are_read():
    """By the protocol they are JSON as text; some servers send the object itself."""
    reply = completion(Reply())
    step = {"thought": "by a tool", "command": None, "messages": []}
    calls = [{"function": {"name": "step", "arguments": None}}, {"function": {"name": "step", "arguments": step}}]
    reply["choices"][0]["message"] = {"role": "assistant", "content": None, "tool_calls": calls}
    with serve([Reply(body=json.dumps(reply))]) as server:
        answer = await DirectClient(server.url).complete(ChatRequest("m", (ChatMessage("user", "hi"),)), 60)
    assert json.loads(answer.text) == step


@pytest.mark.parametrize(
    ("usage", "counted"),
    [
        ({"prompt_tokens": 1000.0, "completion_tokens": "20"}, 1020),
        ({"prompt_tokens": -5, "completion_tokens": 20}, 0),
        ({"prompt_tokens": 10**30, "completion_tokens": 20}, 0),
        ([1, 2], 0),
        (None, 0),
    ],
)
async def test_an_answer_with_an_impossible_token_count_is_kept_and_counts_in_full(usage, counted):
    reply = completion(Reply("hi")) | {"usage": usage}
    calls = CountedCalls()
    with serve([Reply(body=json.dumps(reply))]) as server:
        model = open_model(options(model="gpt-5.5", base_url=server.url), calls)
        answer = await model.ask(0, (ChatMessage("user", "hi"),), CallDeadline(600))
    assert answer.text == "hi"
    assert answer.prompt_tokens + answer.completion_tokens == counted
    ((request, result),) = calls.ended
    assert result.unknown_usd == (0.0 if counted else request.most_usd) and request.most_usd


class CountedCalls(UnrecordedCalls):
    """A record that stores the results of the calls."""

    def __init__(self) -> None:
        self.ended = []

    def end(self, request, result):
        self.ended.append((request, result))


async def test_cached_tokens_have_their_own_price():
    reply = completion(Reply())
    reply["usage"] = {
        "prompt_tokens": 1000, "completion_tokens": 10, "prompt_tokens_details": {"cached_tokens": 900}
    }  # fmt: skip
    with serve([Reply(body=json.dumps(reply))]) as server:
        model = open_model(options(model="gpt-5.5", base_url=server.url), UnrecordedCalls())
        await model.ask(0, (ChatMessage("user", "hi"),), CallDeadline(20))
    assert model.bill().cost_usd == pytest.approx((100 * 5.0 + 900 * 0.5 + 10 * 30.0) / 1e6)
    assert model.bill().calls == 0


async def test_the_key_of_a_listed_service_is_not_sent_to_another_service(monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-listed-key-0123456789")
    with serve([Reply()]) as server:
        model = open_model(options(model="gpt-5.5", base_url=server.url), UnrecordedCalls())
        await model.ask(0, (ChatMessage("user", "hi"),), CallDeadline(20))
    assert server.keys == [""]


async def test_an_own_list_of_models_adds_and_replaces_entries(tmp_path, monkeypatch):
    monkeypatch.setenv("OWN_KEY", "own-key-0123456789")
    with serve([Reply()]) as server:
        path = own_list(
            tmp_path,
            f"""
            [services.lab]
            base_url = "{server.url}"
            key_variable = "OWN_KEY"
            [models."qwen3-vl-8b"]
            service = "lab"
            served = "our-finetune"
            [models.another]
            service = "vllm"
            served = "x"
            """,
        )
        model = open_model(options(model="qwen3-vl-8b", models=path), UnrecordedCalls())
        await model.ask(0, (ChatMessage("user", "hi"),), CallDeadline(20))
        assert server.requests[0]["model"] == "our-finetune"
        assert server.keys == ["Bearer own-key-0123456789"]
    assert set(read_models(Path(path)).models) == {*PAPER, "another"}
    monkeypatch.setenv("LINGJING_MODELS", path)
    assert "another" in read_models().models
    monkeypatch.delenv("LINGJING_MODELS")
    (tmp_path / "config" / "lingjing").mkdir(parents=True)
    Path(path).rename(tmp_path / "config" / "lingjing" / "models.toml")
    assert "another" in read_models().models


def test_all_faults_of_a_list_of_models_are_reported_at_once_with_their_paths(tmp_path):
    path = own_list(
        tmp_path,
        """
        [services.lab]
        base_url = "lab.example"
        concurrency = 0
        [models.one]
        service = "nowhere"
        served = "one"
        price_in = -1.0
        temprature = "no"
        [models.two]
        service = "lab"
        limit = "tokens"
        [models.three]
        service = "lab"
        served = "three"
        price_in = 1.0
        [[families]]
        images = "yes"
        """,
    )
    with pytest.raises(UsageError) as caught:
        read_models(Path(path))
    faults = {fault.where: fault.message for fault in caught.value.faults}
    assert faults == {
        "services.lab.base_url": "it does not begin with http:// or https:// and a host",
        "services.lab.concurrency": "is 0, at least 1 is due",
        "models.one.price_in": "is -1, at least 0 is due",
        "models.one.temprature": "is not known",
        "models.one.service": f"no service is called `nowhere`; there are: {', '.join(read_models().services)}, lab",
        "models.two.served": "is missing",
        "models.two.limit": "is 'tokens', 'max_tokens' or 'max_completion_tokens' is due",
        "models.three": "price_in and price_out go together: give both, or neither",
        "families.0.pattern": "is missing",
        "families.0.images": "is 'yes', yes or no is due",
    }
    assert all(f"{path}: {where}: " in str(caught.value) for where in faults)


def test_a_fault_in_the_environments_list_of_models_is_reported_like_one_in_the_options(tmp_path, monkeypatch):
    path = own_list(tmp_path, "[models.one]\nservice = 'nowhere'\n")
    messages = []
    for arguments in ({}, {"models": path}):
        monkeypatch.setenv("LINGJING_MODELS", "" if arguments else path)
        with pytest.raises(UsageError, match="no service is called `nowhere`") as caught:
            options(model="one", **arguments)
        messages.append(str(caught.value))
    assert messages[0] == messages[1] and f"{path}: models.one.service: " in messages[0]


@pytest.mark.parametrize("text", ["models = 3", "[models]\nx = 1", "services = []", "[[models]]"])
def test_a_list_of_models_of_the_wrong_shape_is_reported(tmp_path, text):
    with pytest.raises(UsageError, match=r"an object is due|a list is due"):
        read_models(Path(own_list(tmp_path, text)))


@pytest.mark.parametrize(
    ("data", "error"), [(b"[models", "is not TOML"), (b"\xff", "is not TOML"), (b"a=" + b"[" * 5000, "TOML")]
)
def test_invalid_toml_is_reported(tmp_path, data, error):
    path = tmp_path / "own.toml"
    path.write_bytes(data)
    with pytest.raises(UsageError, match=error):
        read_models(path)


def test_a_model_that_cannot_be_called_is_reported(tmp_path):
    with pytest.raises(UsageError, match="cannot read the models in"):
        options(model="gpt-5.5", models=str(tmp_path / "missing.toml"))
    with pytest.raises(UsageError, match=r"or a model of the list; did you mean `gpt-5.5`\?$"):
        options(model="GPT-5.5")
    with pytest.raises(UsageError, match=r"or a model of the list; `lingjing plugins` lists them$"):
        options(model="somebody's")
    with pytest.raises(UsageError, match="OPENAI_API_KEY`, which is not set"):
        open_model(options(model="gpt-5.5"), UnrecordedCalls())


class Capped(UnrecordedCalls):
    capped = True


def test_a_limit_of_money_requires_a_price():
    arguments = {"model": "qwen3-vl-flash", "base_url": "http://localhost:1/v1"}
    with pytest.raises(UsageError, match="the price of `qwen3-vl-flash` is not known"):
        open_model(options(**arguments), Capped())
    for more in ({"price_in": 0, "price_out": 0}, {"price_in": 1, "price_out": 2}):
        assert open_model(options(**arguments, **more), Capped()).profile.traits.priced


def test_the_command_plugins_lists_the_other_plugins_if_the_own_list_of_models_is_faulty(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "own.toml").write_text("[models.mine]\nserved = 3\nprice_in = 1.0\n")
    monkeypatch.setenv("LINGJING_MODELS", str(tmp_path / "own.toml"))
    assert run_command(["plugins"]) == ExitCode.USAGE
    printed = capsys.readouterr()
    assert {line.split()[0] for line in printed.out.splitlines()} == {
        "engine", "policy", "scene", "evaluator", "detector", "backbone", "scaffold", "writer",
    }  # fmt: skip
    assert "models.mine.service: is missing" in printed.err
    assert "hint: models.toml" in printed.err
    assert run_command(["plugins", "react"]) == ExitCode.OK
    assert "max_tokens" in capsys.readouterr().out
    assert run_command(["plugins", "gpt-5.5"]) == ExitCode.USAGE
    assert "models.mine.service: is missing" in capsys.readouterr().err
