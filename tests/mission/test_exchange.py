"""The graph for other programs: a script that imports networkx alone reads a mission from its GraphML and its JSON."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import compiled, instantiate, run_command

if TYPE_CHECKING:
    import networkx as nx

    from lingjing.mission.instance import Instance

SCRIPT = Path(__file__).parents[2] / "examples" / "mission_graph.py"
NINE = ("bi", "cd", "cr", "idf", "ld", "ssr", "ufr", "upr", "vdn")
COLUMNS = [(name, mode) for name in NINE for mode in compiled(name).modes.allowed]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Path]]:
    """The GraphML and the JSON of every shipped mission, as the command line writes them."""
    folder = tmp_path_factory.mktemp("compiled")
    written = {}
    for name in NINE:
        xml, text = folder / f"{name}.graphml", folder / f"{name}.json"
        assert run_command(["compile", name, "--emit", "graphml", "-o", str(xml)]) == ExitCode.OK
        assert run_command(["compile", name, "-o", str(text)]) == ExitCode.OK
        written[name] = xml, text
    return written


@pytest.fixture(scope="module")
def networkx() -> Any:
    import networkx as nx

    return nx


def run(path: Path, mode: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """The output of the example script."""
    monkeypatch.setattr("sys.argv", [str(SCRIPT), str(path), mode])
    capsys.readouterr()
    runpy.run_path(str(SCRIPT), run_name="__main__")
    return json.loads(capsys.readouterr().out)


def group_of(name: str) -> str:
    return name.partition("[")[0]


def expected_roles(instance: Instance) -> dict[str, set[str]]:
    agents: dict[str, set[str]] = {}
    for agent in instance.agents:
        agents.setdefault(f"role:{agent.role}", set()).add(f"agent:{group_of(agent.id)}")
    return agents


def expected_topology(instance: Instance) -> dict[str, tuple[set[str], set[str], str | None]]:
    roles = {agent.role for agent in instance.agents}
    named = {
        spec.kind: tuple(
            {f"role:{role}" for role in (roles if "all" in names else roles & set(names))}
            for names in (spec.senders, spec.recipients)
        )
        for spec in instance.messages
    }
    hub = f"agent:{group_of(instance.comms.hub)}" if instance.comms.hub else None
    return {f"channel:{kind}": (*ends, hub) for kind, ends in named.items() if all(ends)}


def expected_actions(instance: Instance) -> dict[str, dict[str, dict[str, list[float | None]]]]:
    """Verbs with the bounds of their arguments; an elevation is limited by the altitude band as well."""
    actions: dict[str, dict[str, dict[str, list[float | None]]]] = {}
    entities = {entity.id: entity for entity in instance.entities}
    for agent in instance.agents:
        verbs = actions.setdefault(f"role:{agent.role}", {})
        for entity in (entities[name] for name in agent.commands):
            low, high = entity.number("band_low_m"), entity.number("band_high_m")
            for verb in entity.verbs:
                verbs[f"verb:{entity.group}.{verb.name}"] = {
                    spec.name: [low, high] if spec.name == "z" and low is not None else [spec.minimum, spec.maximum]
                    for spec in verb.arguments
                }
    return actions


def test_the_script_is_short_and_imports_no_module_of_this_project() -> None:
    lines = SCRIPT.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 30
    assert not any("lingjing" in line for line in lines)


@pytest.mark.parametrize(("name", "mode"), COLUMNS)
def test_the_script_reads_what_the_mission_declares(
    name: str,
    mode: str,
    files: dict[str, tuple[Path, Path]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    xml, text = files[name]
    read = run(xml, mode, monkeypatch, capsys)
    assert run(text, mode, monkeypatch, capsys) == read

    instance = instantiate(compiled(name), seed=3, mode=mode)
    assert {role: set(agents) for role, agents in read["roles"].items()} == expected_roles(instance)
    topology = {
        kind: (set(ends["from"]), set(ends["to"]), ends["through"])
        for kind, ends in read["topology"].items()
        if ends["from"] and ends["to"]  # a kind may have no sender in this mode
    }
    assert topology == expected_topology(instance)
    assert read["actions"] == expected_actions(instance)
    hidden = {f"fact:{entity.group}.{field}" for entity in instance.entities for field in entity.hidden}
    assert set(read["hidden"]) == hidden
    reaches = {
        f"event:{spec.name} {entity.role}:{entity.group}": spec.within_m
        for entity in instance.entities
        for spec in entity.interactions
    }
    assert reaches.items() <= read["radii"].items()
    for inspection in instance.inspections:
        assert read["radii"][f"inspection:{inspection.name}"] == inspection.within_m


@pytest.mark.parametrize("name", NINE)
def test_networkx_reads_the_same_graph_from_graphml_and_json(
    name: str, files: dict[str, tuple[Path, Path]], networkx: Any
) -> None:
    xml, text = files[name]
    from_xml: nx.MultiDiGraph[str] = networkx.read_graphml(xml, force_multigraph=True)
    value = json.loads(text.read_text(encoding="utf-8"))["graph"]
    from_json: nx.MultiDiGraph[str] = networkx.node_link_graph(value, edges="edges")
    assert dict(from_xml.nodes(data=True)) == dict(from_json.nodes(data=True))
    edges = [
        sorted((s, t, key, *sorted((k, str(v)) for k, v in data.items() if k != "id")) for s, t, key, data in each)
        for each in (from_xml.edges(keys=True, data=True), from_json.edges(keys=True, data=True))
    ]
    assert edges[0] == edges[1]
    assert len(from_json.edges) == len(value["edges"])
    assert from_json.graph["mission"] == name


def test_the_graph_connects_hidden_values_to_the_rules_and_verbs_that_they_decide(
    files: dict[str, tuple[Path, Path]], networkx: Any
) -> None:
    read: nx.MultiDiGraph[str] = networkx.read_graphml(files["upr"][0], force_multigraph=True)
    quantity = read.nodes["quantity:leak.position"]
    assert quantity["hidden"] and quantity["detail"] == "position"
    leaves = [source for source, _, data in read.in_edges("quantity:leak.position", data=True)]
    conditions = {source for leaf in leaves for source in read.predecessors(leaf)}
    decided = {
        target for c in conditions for _, target, data in read.out_edges(c, data=True) if data["kind"] == "decides"
    }
    assert {"rule:sealed", "verb:dog.forward", "outcome:success"} <= decided
    assert read.nodes["condition:permit/dog.forward"]["declassified"].startswith("dog.forward: ")
    assert {s for s, _, d in read.in_edges("quantity:dog.position", data=True) if d["kind"] == "changes"} == {
        "verb:dog.forward",
        "verb:dog.left",
        "verb:dog.right",
    }
    assert (read.nodes["quantity:now"]["least"], read.nodes["quantity:now"]["most"]) == (0, 1500)


def written(text: str, folder: Path, emit: str) -> str:
    """The output of `compile` for the text of a mission."""
    source, output = folder / "own.ljs", folder / f"own.{emit}"
    source.write_text(text, encoding="utf-8")
    assert run_command(["compile", str(source), "--emit", emit, "-o", str(output)]) == ExitCode.OK
    return output.read_text(encoding="utf-8")


SMALL = """ljs 2
use std.air { quadrotor }
mission small "Small" {
  goal "Fly."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 30 }
  mode broadcast
  asset uav : quadrotor { position = (300 m, -620 m, 1 m), band = 20 m..HIGH
    actions { takeoff, setDestination } }
  agent scout as searcher controls uav { observes uav.* }
  success when now > 60 s
}
"""


def test_titles_with_markup_are_read_back_unchanged(tmp_path: Path, networkx: Any) -> None:
    text = SMALL.replace("HIGH", "90 m").replace('"Small"', "\"a<b> & 'c' ]]> ü 灵\"")
    read = networkx.parse_graphml(written(text, tmp_path, "graphml"))
    assert read.graph["title"] == "a<b> & 'c' ]]> ü 灵"


def test_characters_that_xml_cannot_hold_become_spaces(tmp_path: Path, networkx: Any) -> None:
    document = json.loads(written(SMALL.replace("HIGH", "90 m"), tmp_path, "mission"))
    document["goal"] = "fly \x1b[31m\x00 \ufffe"
    source, output = tmp_path / "own.json", tmp_path / "own.graphml"
    source.write_text(json.dumps(document), encoding="utf-8")
    assert run_command(["compile", str(source), "--emit", "graphml", "-o", str(output)]) == ExitCode.OK
    assert networkx.read_graphml(output).graph["goal"] == "fly  [31m   "


def test_a_bound_that_depends_on_a_parameter_uses_the_default_of_the_parameter(tmp_path: Path, networkx: Any) -> None:
    high = {}
    for bound in ("90 m", "height"):
        text = SMALL.replace("HIGH", bound).replace("  mode", "  param height = 70 m in 40 m..80 m\n  mode")
        read = networkx.parse_graphml(written(text, tmp_path, "graphml"))
        high[bound] = read.nodes["argument:uav.setDestination.z"]["most"]
    assert high == {"90 m": 90.0, "height": 70.0}


@pytest.mark.parametrize("option", [["--seed", "1"], ["--mode", "star"], ["--set", "uavs=2"], ["--plain"]])
def test_graphml_output_rejects_the_options_of_a_single_instance(
    option: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["compile", "ssr", "--emit", "graphml", *option]) == ExitCode.USAGE
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "graphml" in captured.err
