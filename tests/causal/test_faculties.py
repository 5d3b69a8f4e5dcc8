"""Parts of decisions and the truth: each faculty replaces only its own part; the documentation has the same table."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import pytest

import lingjing
from lingjing.causal.faculties import FACULTIES, TrueSituation, faculties_of, replace_faculty, right_parts
from lingjing.causal.shapley import shapley_shares
from lingjing.mission.instance import Instance
from lingjing.testing import instantiate, shipped_missions
from lingjing.trace.records import Action, BodyState, Box, CameraPose, Decision, Faculty, FrameInfo, Outgoing

PAGE = Path(__file__).parents[2] / "docs" / "attribution.md"
NAMES: tuple[Faculty, ...] = get_args(Faculty)
TRUE_BOX, FALSE_BOX = (0.4, 0.4, 0.6, 0.6), (0.0, 0.0, 0.1, 0.1)
TRUE_PLACE, FALSE_PLACE = (100.0, 200.0, 0.0), (190.0, 200.0, 0.0)


@pytest.fixture(scope="module")
def sea() -> Instance:
    mission = lingjing.compile(next(path for path in shipped_missions() if path.stem == "ssr"))
    return instantiate(mission, seed=1, mode="star")


def scene(instance: Instance, agent: str) -> TrueSituation:
    pose = CameraPose(position=(0.0, 0.0, 100.0), heading_deg=0.0, tilt_deg=90.0)
    box = Box(entity="victim[1]", cls="person_in_water", box=TRUE_BOX, pixels=90)
    frame = FrameInfo(
        id="f1", entity="uav[1]", camera="nadir", tick=1, time_s=10.0, pose=pose, channels=("rgb",), boxes=(box,)
    )
    state = BodyState(id="victim[1]", position=TRUE_PLACE)
    registry: Any = SimpleNamespace(
        frames={"f1": frame}, frame_states={"f1": {"victim[1]": state}}, states={"victim[1]": state}
    )
    return TrueSituation(instance, next(spec for spec in instance.agents if spec.id == agent), registry)


def report(box: tuple[float, ...] = TRUE_BOX, place: tuple[float, ...] = TRUE_PLACE, cls: str = "") -> Outgoing:
    body: dict[str, Any] = {"frame": "f1", "class": cls or "person_in_water", "box": box, "position": place}
    return Outgoing(kind="detection", body={**body, "confidence": 1.0})


def order(assignee: str = "skipper", place: tuple[float, ...] = TRUE_PLACE) -> Outgoing:
    return Outgoing(kind="assignment", body={"assignee": assignee, "task": "rescue", "position": place})


def fly(x: float, verb: str = "setDestination") -> Action:
    return Action(verb=verb, arguments={"x": x, "y": 0.0, "z": 60.0}, resource="uav[1]")


SCOUT = "scout[1]"
CASES: tuple[tuple[Faculty, str, Decision, Decision], ...] = (
    ("perception", SCOUT, Decision(), Decision(messages=(report(),))),
    ("perception", SCOUT, Decision(messages=(report(FALSE_BOX),)), Decision(messages=(report(),))),
    ("perception", SCOUT, Decision(messages=(report(cls="boat"),)), Decision(messages=(report(),))),
    ("localisation", SCOUT, Decision(messages=(report(place=FALSE_PLACE),)), Decision(messages=(report(),))),
    ("waypoint", SCOUT, Decision(command=fly(500.0)), Decision(command=fly(0.0))),
    ("handoff", "commander", Decision(), Decision(messages=(order(),))),
    ("handoff", "commander", Decision(messages=(order("scout[2]"),)), Decision(messages=(order(),))),
    ("handoff", "commander", Decision(messages=(order(place=FALSE_PLACE),)), Decision(messages=(order(),))),
    ("execution", SCOUT, Decision(), Decision(command=fly(0.0))),
    ("execution", SCOUT, Decision(command=Action(verb="stop", resource="uav[1]")), Decision(command=fly(0.0))),
)


@pytest.mark.parametrize(("faculty", "agent", "wrong", "right"), CASES)
def test_a_fault_is_corrected_only_by_its_own_faculty(
    sea: Instance, faculty: Faculty, agent: str, wrong: Decision, right: Decision
) -> None:
    at = scene(sea, agent)
    assert replace_faculty(faculty, wrong, right, at) == right
    for other in set(NAMES) - {faculty}:
        assert replace_faculty(other, wrong, right, at) is wrong
    for name in NAMES:
        assert replace_faculty(name, right, right, at) is right


@pytest.mark.parametrize(("faculty", "agent", "wrong", "right"), CASES)
def test_only_existing_parts_of_a_decision_are_reported_as_right(
    sea: Instance, faculty: Faculty, agent: str, wrong: Decision, right: Decision
) -> None:
    at = scene(sea, agent)
    moves = {"waypoint", "execution"} if right.command is not None else set()
    reports = {"perception", "localisation"} if agent == SCOUT and right.messages else set()
    whole = moves | reports or {"handoff"}
    assert right_parts(right, right, at) == whole
    assert faculty not in right_parts(wrong, right, at)
    assert right_parts(Decision(), right, at) == set()  # a missing command or message is no part
    assert right_parts(right, Decision(), at) == reports  # without a reference, only what a picture shows


def test_parts_that_agree_within_the_tolerances_are_not_replaced(sea: Instance) -> None:
    at = scene(sea, SCOUT)
    mine = Decision(command=fly(9.0), messages=(report((0.42, 0.4, 0.6, 0.6), (109.0, 200.0, 0.0)),))
    right = Decision(command=fly(0.0), messages=(report(),))
    assert all(replace_faculty(name, mine, right, at) is mine for name in NAMES)


def test_a_wrong_position_is_corrected_in_every_message(sea: Instance) -> None:
    mine = Decision(messages=(report(place=FALSE_PLACE), order(place=FALSE_PLACE)))
    after = replace_faculty("localisation", mine, Decision(), scene(sea, SCOUT))
    assert [message.body["position"] for message in after.messages] == [TRUE_PLACE, TRUE_PLACE]


def test_agents_have_the_faculties_of_their_roles(sea: Instance) -> None:
    has = {agent.id: faculties_of(sea, agent) for agent in sea.agents}
    assert has["scout[1]"] == ("perception", "localisation", "waypoint", "handoff", "execution")
    assert has["skipper"] == ("waypoint", "handoff", "execution")
    assert has["commander"] == ("handoff",)


def test_every_shipped_mission_has_faculties_and_walkers_and_drivers_have_routing() -> None:
    moving: dict[str, set[Faculty]] = {}
    for path in shipped_missions():
        mission = lingjing.compile(path)
        instance = instantiate(mission, seed=1)
        faculties = {faculty for agent in instance.agents for faculty in faculties_of(instance, agent)}
        moving[mission.name] = faculties & {"waypoint", "routing"}
        assert "execution" in faculties
    assert moving["ssr"] == {"waypoint"} and moving["upr"] >= {"routing", "waypoint"} and "routing" in moving["cd"]


def test_the_page_on_attribution_has_the_table_of_faculties() -> None:
    rows = [f"| `{row.name}` | {row.meaning} | {row.record} | {row.truth} |" for row in FACULTIES]
    between = PAGE.read_text(encoding="utf-8").partition("<!-- faculties -->\n")[2].partition("<!-- end")[0]
    assert between.splitlines()[2:] == rows
    assert tuple(row.name for row in FACULTIES) == NAMES


def game(*winning: set[str]) -> Any:
    """Return values of coalitions: those that contain one of the sets win."""
    return lambda sets: [float(any(group <= {agent for _, agent in some} for group in winning)) for some in sets]


def test_shapley_shares_match_games_computed_by_hand() -> None:
    players: list[tuple[Faculty, str]] = [("waypoint", "a"), ("waypoint", "b"), ("waypoint", "c")]
    either = shapley_shares(players, game({"a"}, {"b"}), exact=True, seed=0)
    assert [(share.agent, share.share) for share in either] == [("a", 0.5), ("b", 0.5), ("c", 0.0)]
    # a with b, or a alone with c: a is needed (4/6), b and c each in one of six orders
    needed = shapley_shares(players, game({"a", "b"}, {"a", "c"}), exact=True, seed=0)
    assert [share.share for share in needed] == pytest.approx([4 / 6, 1 / 6, 1 / 6])
    sampled = shapley_shares(players, game({"a", "b"}, {"a", "c"}), exact=False, seed=0)
    assert sum(share.share for share in sampled) == pytest.approx(1.0)
    for share, truth in zip(sorted(sampled, key=lambda share: share.agent), (4 / 6, 1 / 6, 1 / 6), strict=True):
        assert share.low <= truth <= share.high and not share.exact
    assert shapley_shares(players, lambda sets: [None] * len(sets), exact=True, seed=0) == ()
