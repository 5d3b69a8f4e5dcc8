"""From mission to instance: settings, modes, places, agents, determinism."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from lingjing.errors import MissionError, UsageError
from lingjing.mission.instance import ChannelSpec, Entity, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.testing import declarations as m
from lingjing.testing import expressions as ex
from lingjing.testing.documents import encode

ROOT = Path(__file__).resolve().parents[2]
SEEDS = st.integers(0, 2**31)


def group_of(instance: Instance, name: str) -> tuple[Entity, ...]:
    return tuple(entity for entity in instance.entities if entity.group == name)


def with_group(mission: m.Mission, name: str, **changes: object) -> m.Mission:
    groups = tuple(replace(group, **changes) if group.name == name else group for group in mission.groups)
    return replace(mission, groups=groups)


def properties_of(mission: m.Mission, name: str) -> tuple[m.Property, ...]:
    return next(group.properties for group in mission.groups if group.name == name)


def test_an_instance_has_the_layout_of_its_mission(ssr: m.Mission) -> None:
    instance = instantiate(ssr, seed=7)
    assert [entity.id for entity in instance.entities] == [
        *("victim[1]", "victim[2]", "victim[3]", "uav[1]", "uav[2]", "uav[3]", "boat")
    ]
    assert [entity.position for entity in group_of(instance, "uav")] == [
        *((306.6, -620.2, 1.1), (310.0, -590.1, 1.1), (278.7, -590.1, 1.1))
    ]
    (boat,) = group_of(instance, "boat")
    assert boat.position == (12.4, -1351.8, -3.5), "two components stand on the scene's datum"
    assert boat.heading_deg == 30.0 and boat.properties == {"speed_mps": 3.0}
    victim = group_of(instance, "victim")[0]
    assert victim.hidden == ("position",) and victim.properties == {"drift_mps": 0.1}
    assert instance.weather.wind_mps == 4.0 and 0.2 <= instance.weather.wave_height_m <= 0.8
    assert instance.settings == {"uavs": 3.0, "victims": 3.0, "altitude": 100.0}
    assert len(instance.cells) == 9 and instance.cells[0].name == "cells-1-1"
    assert (instance.clock.tick_s, instance.clock.sync_s, instance.budget.ticks) == (10.0, 0.5, 60)
    assert instance.rules == ssr.rules and instance.success == ssr.success


def test_regions_are_anticlockwise(ssr: m.Mission) -> None:
    from lingjing.mission.geometry2d import signed_area

    (search,) = instantiate(ssr).regions
    assert signed_area(search.polygon) > 0
    assert set(search.polygon) == {(665.1, -1081.1), (-123.7, -1100.5), (-123.7, -750.2), (665.1, -754.9)}


def test_broadcast_has_no_commander_and_shares_the_boat(ssr: m.Mission) -> None:
    instance = instantiate(ssr)
    assert instance.mode == "broadcast" and instance.comms.hub is None
    assert [agent.id for agent in instance.agents] == ["scout[1]", "scout[2]", "scout[3]", "skipper"]
    assert instance.agents[1].controls == ("uav[2]",)
    assert instance.agents[1].commands == ("uav[2]", "boat")
    assert instance.agents[3].commands == ("boat",)
    assert instance.agents[1].observes == (
        ChannelSpec(source="entity", name="uav[2]"),
        ChannelSpec(source="grid", name="cells"),
        ChannelSpec(source="peers", fields=("position",)),
        ChannelSpec(source="events"),
    )
    assert [(spec.kind, spec.senders) for spec in instance.messages] == [
        ("detection", ("searcher",)),
        ("assignment", ("searcher",)),
    ]
    assert [relation.kind for relation in instance.relations] == ["cooperation"]


def test_star_routes_through_the_commander(ssr: m.Mission) -> None:
    instance = instantiate(ssr, mode="star")
    assert instance.comms.hub == "commander" and instance.comms.delay_ticks == 1
    assert [agent.id for agent in instance.agents][-1] == "commander"
    assert instance.agents[0].commands == ("uav[1]",)
    assert [relation.kind for relation in instance.relations] == ["cooperation", "guidance"]


@given(SEEDS, st.integers(1, 5))
def test_fewer_victims_are_a_prefix_of_more_victims(ssr: m.Mission, seed: int, count: int) -> None:
    fewer = group_of(instantiate(ssr, seed=seed, settings={"victims": count}), "victim")
    more = group_of(instantiate(ssr, seed=seed, settings={"victims": count + 1}), "victim")
    assert fewer == more[:count]


@given(SEEDS)
def test_an_added_declaration_leaves_other_draws_unchanged(ssr: m.Mission, seed: int) -> None:
    gust = m.Property(name="turbulence", value=ex.Draw("uniform", (ex.Number(0.0), ex.Number(0.3))), relation="~")
    buoys = m.Group(
        name="buoy",
        role="target",
        type="buoy",
        engine="city",
        count=ex.Number(4.0),
        properties=(
            m.Property(name="position", value=ex.Draw("sites", (ex.Ref("search", "region"),)), relation="~"),
            m.Property(name="mass_kg", value=ex.Draw("normal", (ex.Number(9.0), ex.Number(1.0))), relation="~"),
        ),
    )
    edited = replace(ssr, weather=(gust, *ssr.weather), groups=(buoys, *ssr.groups))
    before, after = instantiate(ssr, seed=seed), instantiate(edited, seed=seed)
    assert after.entities[4:] == before.entities
    assert after.weather.wave_height_m == before.weather.wave_height_m
    assert after.scene == before.scene
    assert len({entity.properties["mass_kg"] for entity in after.entities[:4]}) == 4


@given(SEEDS, st.sampled_from(["star", "broadcast"]))
def test_instances_round_trip_as_json(ssr: m.Mission, seed: int, mode: str) -> None:
    instance = instantiate(ssr, seed=seed, mode=mode)
    assert msgspec.json.decode(msgspec.json.encode(instance), type=Instance) == instance


def test_seeds_differ_and_modes_share_their_draws(ssr: m.Mission) -> None:
    first, second = instantiate(ssr, seed=1), instantiate(ssr, seed=2)
    assert group_of(first, "victim") != group_of(second, "victim")
    assert first.scene.seed != second.scene.seed
    assert instantiate(ssr, seed=1, mode="star").entities == first.entities


def test_two_processes_with_different_hash_seeds_agree(ssr: m.Mission, tmp_path: Path) -> None:
    (tmp_path / "mission.json").write_text(encode(ssr), encoding="utf-8")
    program = (
        "import sys, msgspec; from lingjing.mission.document import decode\n"
        "from lingjing.mission.instantiate import instantiate\n"
        "mission = decode(open('mission.json', encoding='utf-8').read(), 'mission.json')\n"
        "sys.stdout.buffer.write(msgspec.json.encode(instantiate(mission, seed=11, settings={'uavs': 9})))\n"
    )
    outputs = [_run(program, tmp_path, hash_seed) for hash_seed in ("0", "4242")]
    assert outputs[0] == outputs[1] == msgspec.json.encode(instantiate(ssr, seed=11, settings={"uavs": 9}))


def test_no_large_package_is_imported(tmp_path: Path) -> None:
    program = (
        "import sys, lingjing.mission.instantiate, lingjing.mission.document\n"
        "heavy = {'numpy', 'pydantic', 'pluggy', 'rich', 'mujoco', 'libsumo', 'shapely', 'cv2', 'gymnasium', 'mcap'}\n"
        "sys.stdout.write(' '.join(sorted(heavy & sys.modules.keys())))\n"
    )
    assert _run(program, tmp_path, "0") == b""


def _run(program: str, folder: Path, hash_seed: str) -> bytes:
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=folder, env=environment, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


@pytest.mark.parametrize(
    ("arguments", "words", "hint"),
    [
        ({"mode": "mesh"}, "mission 'ssr' has no mode 'mesh'", "star, broadcast"),
        ({"settings": {"victim": 2}}, "no parameter 'victim'", "did you mean 'victims'? it has uavs, victims"),
        ({"settings": {"zzz": 2}}, "no parameter 'zzz'", "it has uavs, victims, altitude"),
        ({"settings": {"uavs": 11}}, "uavs = 11 is outside of its range 1..10", ""),
        ({"settings": {"altitude": 5}}, "altitude = 5 is outside of its range 40 m..160 m", ""),
        ({"settings": {"altitude": float("nan")}}, "altitude = nan is not a number", "a number"),
        ({"settings": {"altitude": "high"}}, "altitude = 'high' is not a number", "a number"),
    ],
)
def test_errors_of_wrong_arguments_name_the_allowed_values(
    ssr: m.Mission, arguments: dict[str, object], words: str, hint: str
) -> None:
    with pytest.raises(UsageError) as caught:
        instantiate(ssr, **arguments)  # type: ignore[arg-type]
    assert words in str(caught.value) and hint in caught.value.hint


FIELD_OF_VIEW = m.Property(name="wind", value=ex.Number(1.0))
FAULTS: dict[str, tuple[Callable[[m.Mission], m.Mission], str]] = {
    "tick": (
        lambda s: replace(s, clock=m.ClockDeclaration(tick=ex.Number(10.0, "s"), sync=ex.Number(0.3, "s"))),
        "ssr/clock: tick = 10 s is no whole multiple of sync = 0.3 s",
    ),
    "budget": (
        lambda s: replace(s, budget=replace(s.budget, ticks=ex.Number(0.0))),
        "ssr/budget: every limit must be above 0",
    ),
    "weather": (lambda s: replace(s, weather=(FIELD_OF_VIEW,)), "ssr/weather: there is no 'wind'"),
    "position": (
        lambda s: with_group(s, "boat", properties=properties_of(s, "boat")[1:]),
        "ssr/boat has no position",
    ),
    "crowd": (
        lambda s: with_group(
            s,
            "victim",
            properties=(
                m.Property(
                    name="position",
                    value=ex.Draw("sites", (ex.Ref("search", "region"),), (("apart", ex.Number(2000.0, "m")),)),
                ),
            ),
        ),
        "ssr/victim/position: 3 places at least 2000 m apart do not fit",
    ),
    "half": (
        lambda s: with_group(s, "uav", count=ex.Number(2.5)),
        "ssr/uav: expected a whole number, got 2.5",
    ),
    "hub": (lambda s: replace(s, comms=m.Comms(hub="admiral")), "ssr/comms: the hub 'admiral' is no agent"),
    "no hub": (lambda s: replace(s, comms=m.Comms()), "ssr/comms: star mode has no hub"),
    "too few": (
        lambda s: replace(s, agents=tuple(replace(a, count=ex.Number(4.0)) if a.count else a for a in s.agents)),
        "ssr/scout[4]: there is no member 4, the group has 3",
    ),
    "channel": (
        lambda s: replace(s, agents=(replace(s.agents[1], observes=(m.Channel(source=ex.Symbol("sonar")),)),)),
        "ssr/skipper: 'sonar' cannot be observed",
    ),
    "overlap": (
        lambda s: replace(s, grids=(replace(s.grids[0], overlap=ex.Number(20.0)),)),
        "ssr/cells: an overlap of 2000%",
    ),
    "default": (
        lambda s: replace(s, parameters=(replace(s.parameters[0], default=ex.Number(12.0)), *s.parameters[1:])),
        "ssr/uavs: the default 12 is outside of its range 1..10",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_of_a_mission_name_the_node(ssr: m.Mission, name: str) -> None:
    spoil, words = FAULTS[name]
    with pytest.raises(MissionError) as caught:
        instantiate(spoil(ssr), mode="star")
    assert words in str(caught.value)


def test_scene_options_reach_the_provider(ssr: m.Mission) -> None:
    options = (
        m.Property(name="origin", value=ex.Point((ex.Number(22.3), ex.Number(114.2)))),
        m.Property(name="buoys", value=ex.Number(12.0)),
        m.Property(name="pier", value=ex.Point((ex.Number(5.0), ex.Number(6.0)))),
    )
    scene = instantiate(replace(ssr, scene=m.Scene(kind="bay", options=(*ssr.scene.options, *options)))).scene
    assert scene.origin == (22.3, 114.2) and scene.datum_m == -3.5
    assert scene.options == {"buoys": 12.0, "pier": (5.0, 6.0, -3.5)}


def test_delay_in_seconds_is_rounded_up_to_ticks(ssr: m.Mission) -> None:
    assert instantiate(replace(ssr, comms=m.Comms(delay=ex.Number(12.0, "s")))).comms.delay_ticks == 2
    assert instantiate(replace(ssr, comms=m.Comms(delay=ex.Number(3.0, "ticks")))).comms.delay_ticks == 3
