"""The visibility of state: declared channels and no hidden value; instances that differ only in hidden values look the
same.
"""

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lingjing.mission.instance import ChannelSpec
from lingjing.mission.seeding import integer
from lingjing.testing import does
from lingjing.testing import rescue as kit
from lingjing.trace.records import Decision, Outgoing


def inputs(published):
    return {record.agent: record.sha256 for record in published.record.observations}


@settings(max_examples=25, deadline=None)
@given(place=st.tuples(st.floats(-290, 290), st.floats(60, 290)), mode=st.sampled_from(["star", "broadcast"]))
def test_hidden_positions_do_not_change_policy_inputs_without_a_picture(place, mode):
    first, second = (
        kit.kernel(kit.instance(mode)),
        kit.kernel(kit.instance(mode, victims=(place, place))),
    )
    assert inputs(first.reset()) == inputs(second.reset())
    assert first.briefs() == second.briefs()
    fly = kit.decisions(scout_1=does("go", x=90.0, y=0.0), skipper=does("go", x=0.0, y=-90.0))
    assert inputs(first.step(fly)) == inputs(second.step(fly))


def test_a_picture_changes_only_the_inputs_of_its_agent():
    first, second = kit.kernel(), kit.kernel(kit.instance(victims=((200.0, 200.0), (-100.0, 0.0))))
    for kernel in (first, second):
        kernel.reset()
    before, after = (kernel.step(kit.decisions(scout_1=does("takePhoto"))) for kernel in (first, second))
    assert inputs(before)["scout[1]"] != inputs(after)["scout[1]"]
    assert inputs(before)["skipper"] == inputs(after)["skipper"]


def test_an_agent_sees_its_channels_and_nothing_else():
    observation = kit.kernel(kit.instance("star")).reset().observations
    assert [view.id for view in observation["skipper"].entities] == ["boat"]
    assert observation["commander"].entities == ()
    assert [cell.name for cell in observation["commander"].cells] == ["cells-1-1"]
    assert observation["skipper"].cells == ()
    own, *peers = observation["scout[1]"].entities
    assert (own.id, own.busy, own.status) == ("uav[1]", False, "idle")
    assert [(view.id, view.status, view.position is not None) for view in peers] == [
        ("uav[2]", None, True),
        ("boat", None, True),
    ]


def test_commands_set_the_assignment_of_a_vessel_and_messages_do_not():
    made = kit.instance()
    channel = ChannelSpec(source="entity", name="boat", fields=("assignment",))
    agents = tuple(
        msgspec.structs.replace(agent, observes=(channel,)) if agent.id == "scout[2]" else agent
        for agent in made.agents
    )
    kernel = kit.kernel(msgspec.structs.replace(made, agents=agents))
    assert kernel.reset().observations["scout[2]"].entities[0].assignment is None
    order = Outgoing(kind="assignment", body={"assignee": "skipper", "task": "rescue", "position": (50.0, 0.0, 0.0)})
    received = kernel.step(kit.decisions(scout_1=Decision(messages=(order,)))).observations["scout[2]"]
    assert received.entities[0].assignment is None
    sent = kernel.step(kit.decisions(skipper=does("go", x=0.0, y=-90.0))).observations["scout[2]"]
    assert sent.entities[0].assignment == (0.0, -90.0)


def test_pictures_go_to_the_agents_that_observe_the_camera():
    kernel = kit.kernel()
    kernel.reset()
    published = kernel.step(kit.decisions(scout_1=does("takePhoto")))
    assert {name: len(seen.pictures) for name, seen in published.observations.items()} == {
        "scout[1]": 1,
        "scout[2]": 0,
        "skipper": 0,
    }


@pytest.mark.parametrize(
    ("fields", "pictures"),
    [(("position",), 0), (("position", "busy"), 0), (("nadir",), 1), (("*",), 1), (("other",), 0)],
)
def test_pictures_need_a_channel_that_names_the_camera_or_all_fields(fields, pictures):
    made = kit.instance()
    channel = ChannelSpec(source="entity", name="uav[1]", fields=fields)
    agents = tuple(
        msgspec.structs.replace(agent, observes=(channel,)) if agent.id == "skipper" else agent for agent in made.agents
    )
    kernel = kit.kernel(msgspec.structs.replace(made, agents=agents))
    kernel.reset()
    published = kernel.step(kit.decisions(scout_1=does("takePhoto")))
    assert len(published.observations["skipper"].pictures) == pictures
    assert len(published.observations["scout[1]"].pictures) == 1


def test_only_a_privileged_agent_receives_the_truth_and_the_trace_records_it():
    kernel = kit.kernel(privileged=frozenset({"scout[1]"}))
    published = kernel.reset()
    assert published.observations["scout[2]"].privileged is None
    truth = published.observations["scout[1]"].privileged
    assert "victim[1]" in [state.id for state in truth.states]
    assert [seen.privileged for seen in published.record.observations] == [True, False, False]


def test_blank_pictures_are_black():
    kernel = kit.kernel(blank_pictures=True)
    kernel.reset()
    picture = kernel.step(kit.decisions(scout_1=does("takePhoto"))).observations["scout[1]"].pictures[0]
    assert not picture.rgb.any()


def test_swapped_pictures_show_the_other_instance_and_change_no_record():
    """A person is below `uav[1]` here, and below its second place in the other instance."""
    others = kit.instance(victims=((160.0, 0.0), (250.0, 250.0)))
    plain = kit.kernel(privileged=frozenset({"scout[1]"}))
    kernel = kit.kernel(privileged=frozenset({"scout[1]"}), neighbour=others)
    shown = []
    for each in (plain, kernel):
        each.reset()
        first = each.step(kit.decisions(scout_1=does("takePhoto")))
        for _ in range(6):
            each.step(kit.decisions(scout_1=does("go", x=160.0, y=0.0)))
        last = each.step(kit.decisions(scout_1=does("takePhoto")))
        for published in (first, last):
            seen = published.observations["scout[1]"]
            (frame,) = published.record.frames
            boxes = [box.entity for box in seen.privileged.frames[0].boxes]
            shown.append((bool(seen.pictures[0].rgb.any()), boxes, [box.entity for box in frame.boxes]))
            assert seen.pictures[0].pose == frame.pose, "it is taken from where the body is here"
            assert seen.pictures[0].frame == frame.id
    assert shown[:2] == [(True, ["victim[1]"], ["victim[1]"]), (False, [], [])]
    assert shown[2:] == [(False, [], ["victim[1]"]), (True, ["victim[1]"], [])]


def test_a_cell_is_visited_by_the_first_photograph_from_above_it():
    kernel = kit.kernel()
    kernel.reset()
    kernel.step(kit.decisions(scout_2=does("takePhoto")))
    cells = kernel.step(kit.decisions(scout_1=does("takePhoto"))).observations["scout[1]"].cells
    assert [(cell.visited_tick, cell.visited_by) for cell in cells] == [(1, "uav[2]")]


def test_a_brief_holds_schema_peers_and_public_settings_but_no_target():
    brief = kit.kernel().briefs()["scout[1]"]
    assert [(resource.id, resource.embodied) for resource in brief.resources] == [("uav[1]", True), ("boat", False)]
    assert [peer.id for peer in brief.peers] == ["scout[2]", "skipper"]
    assert brief.classes == ("person", "craft")
    assert "victim[" not in repr(brief)


def test_a_policy_that_modifies_its_inputs_does_not_affect_the_episode():
    def played(spoil):
        kernel = kit.kernel(plugin=kit.RescueEngines(glider=Powered))
        kernel.briefs()["skipper"].settings.update(victims=99.0)
        kernel.reset()
        kernel.step(kit.decisions(scout_1=does("takePhoto")))
        output = kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir", position=(280.0, 0.0))))
        if spoil:
            output.inboxes["skipper"].messages[0].body.clear()
            output.observations["skipper"].entities[0].resources["battery"] = 99.0
        assert output.inboxes["scout[2]"].messages[0].body["class"] == "person"
        return kernel.step(kit.decisions(skipper=does("go", x=280.0, y=0.0))).record

    spoilt, clean = played(True), played(False)
    assert [change.stage for change in clean.stages] == ["handoff"]  # by the reported position
    assert spoilt.digest == clean.digest
    assert spoilt.snapshots[-1].states[-1].resources == {"battery": 1.0}


class Powered(kit.PointMasses):
    def advance(self, until, mirrors):
        boundary = super().advance(until, mirrors)
        for name, state in self.states.items():
            self.states[name] = msgspec.structs.replace(state, resources=state.resources or {"battery": 1.0})
        return msgspec.structs.replace(boundary, states=tuple(self.states.values()))


def test_receipts_of_kernel_commands_are_not_received_by_an_agent_named_kernel():
    instance = kit.instance()
    named = msgspec.structs.replace(instance.agents[2], id="kernel", name="kernel")
    kernel = kit.kernel(msgspec.structs.replace(instance, agents=(*instance.agents[:2], named)))
    kernel.reset()
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir")))
    published = kernel.step(kit.decisions())
    assert [r.resource for r in published.record.receipts] == ["victim[1]"]
    assert published.inboxes["kernel"].receipts == ()


def test_the_hash_of_inputs_does_not_depend_on_blanked_pictures():
    there, elsewhere = kit.instance(), kit.instance(victims=((200.0, 200.0), (-100.0, 0.0)))
    seen = []
    for instance in (there, elsewhere):
        kernel = kit.kernel(instance, blank_pictures=True)
        kernel.reset()
        seen.append(inputs(kernel.step(kit.decisions(scout_1=does("takePhoto")))))
    assert seen[0] == seen[1]


def test_the_seed_of_a_policy_is_independent_of_the_instance_seed():
    """Equal policy seeds give equal briefs whatever the instance's seed; no instance seed gives a brief's seed."""
    first = kit.kernel(policy_seed=5).briefs()
    other = kit.kernel(msgspec.structs.replace(kit.instance(), seed=123_456), policy_seed=5).briefs()
    assert first == other
    seeds = {brief.seed for brief in first.values()}
    assert len(seeds) == len(first), "every agent has a stream of its own"
    assert seeds.isdisjoint(brief.seed for brief in kit.kernel(policy_seed=6).briefs().values())


def test_the_instance_seed_cannot_be_found_from_a_brief_by_search():
    """A search over seeds finds at best the policy seed's own stream, never the instance's."""
    instance = msgspec.structs.replace(kit.instance(), seed=77)
    for agent, brief in kit.kernel(instance).briefs().items():
        paths = (f"{instance.mission}/policy/{agent}", f"policy/{agent}", agent)
        assert brief.seed not in {integer(77, path) for path in paths}
        tried = [seed for seed in range(2000) if brief.seed in {integer(seed, path) for path in paths}]
        assert tried == [0], "the default policy seed, which is public"


def test_a_brief_holds_the_observed_cells_but_no_hidden_cells():
    made = kit.instance()
    secret = msgspec.structs.replace(made.cells[0], name="near-1-1", grid="near", hidden=True)
    unobserved = msgspec.structs.replace(made.cells[0], name="idle-1-1", grid="idle")
    watching = tuple(
        msgspec.structs.replace(agent, observes=(*agent.observes, ChannelSpec(source="grid", name="near")))
        for agent in made.agents
    )
    kernel = kit.kernel(msgspec.structs.replace(made, cells=(*made.cells, secret, unobserved), agents=watching))
    briefs, seen = kernel.briefs(), kernel.reset().observations
    assert {name: [cell.name for cell in brief.cells] for name, brief in briefs.items()} == {
        "scout[1]": ["cells-1-1"],
        "scout[2]": ["cells-1-1"],
        "skipper": [],
    }
    assert all([cell.name for cell in briefs[name].cells] == [cell.name for cell in seen[name].cells] for name in seen)
