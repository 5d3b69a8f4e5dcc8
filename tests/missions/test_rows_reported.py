"""The rows of the adjudication table that begin with a report: BI, UPR, UFR and SSR.

Each row is checked at exactly its radius, just inside and just outside, and with a policy that sends false reports.
Deciding distances are exact: the radii are inclusive to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from lingjing.testing import CENTRE_BOX, Stage, does, reports, says, together
from tests.missions import staging as kit


@dataclass(frozen=True)
class Row:
    """One row: the reporter with its report and picture, the actor, and the names of the adjudicated events.

    `near_m` is the report's radius (None: a region alone decides), `reach_m` the actor's.
    """

    mission: str
    mode: str
    target: str
    reporter: str
    eye: str
    kind: str
    cls: str
    near_m: float | None
    located: str
    interaction: str
    actor: str
    reach_m: float
    executed: str
    axis: tuple[int, int] = (1, 0)

    def report(self, play, tick=1, box=CENTRE_BOX, off=0.0, cls=None, at=None):
        x, y, _ = play.entity(self.target).position
        place = at or (x + off * self.axis[0], y + off * self.axis[1])
        return reports(self.kind, f"f{tick}-{self.eye}-nadir", cls or self.cls, place, box)

    def __str__(self):
        return f"{self.mission}-{self.mode}"


BI = Row("bi", "single", "fracture", "inspector", "uav", "finding", "bridge_fracture", 25.0, "located",
         "inspect", "uav", 25.0, "examined")  # fmt: skip
UPR = Row("upr", "star", "leak[1]", "pilot", "uav", "finding", "pipeline_leak", 10.0, "located",
          "seal", "dog", 5.0, "sealed", axis=(0, 1))  # fmt: skip
UFR = Row("ufr", "broadcast", "fire[1]", "scout[1]", "uav[1]", "detection", "building_fire", 25.0, "located",
          "extinguish", "truck", 30.0, "extinguished")  # fmt: skip
UFR_STAR = Row("ufr", "star", *list(UFR.__dict__.values())[2:])
SSR = Row("ssr", "broadcast", "victim[1]", "scout[1]", "uav[1]", "detection", "person_in_water", None, "reported",
          "rescue", "boat", 50.0, "rescued")  # fmt: skip
SSR_STAR = Row("ssr", "star", *list(SSR.__dict__.values())[2:])

ROWS = (BI, UPR, UFR, UFR_STAR, SSR, SSR_STAR)
RADIAL = tuple(row for row in ROWS if row.near_m is not None)
by_row = pytest.mark.parametrize("row", ROWS, ids=str)


def opened(row):
    """An episode with one target, and its box in the picture of boundary 1."""
    single = {"ufr": {"fires": 1.0}, "ssr": {"victims": 1.0}}.get(row.mission, {})
    inside = {"uav": (0.0, 0.0, 30.0)} if row.mission == "upr" else {}  # its geofence is a hard constraint
    return kit.playing(row.mission, row.mode, stage=Stage(places=inside), **single)


def photograph(row, play):
    play.stage.boxes = {row.target: CENTRE_BOX}
    play.do({row.reporter: does("takePhoto", camera="nadir")})


def judged(row, *reports, act=None):
    """The adjudicated kinds after a picture and then these reports, each a function of the play."""
    with opened(row) as play:
        photograph(row, play)
        play.do({row.reporter: together(*(report(play) for report in reports))})
        return [kind for kind, *_ in play.kinds()]


@by_row
def test_a_true_report_gives_one_event_of_detection_and_one_of_localisation(row):
    assert judged(row, row.report) == ["matched", row.located]


@by_row
@pytest.mark.parametrize(("share", "counts"), [(0.5 + 1e-12, True), (0.51, True), (0.4999, False), (0.0001, False)])
def test_boxes_match_from_an_overlap_of_one_half(row, share, counts):
    events = judged(row, lambda play: row.report(play, box=kit.shifted(share)))
    assert (events == ["matched", row.located]) is counts
    assert bool(events) is counts


@by_row
def test_an_overlap_of_exactly_one_half_matches(row):
    """Boxes of 1/4 by 1/4 and 1/2 by 1/4 have an overlap of exactly one half."""
    with opened(row) as play:
        play.stage.boxes = {row.target: (0.25, 0.25, 0.5, 0.5)}
        play.do({row.reporter: does("takePhoto", camera="nadir")})
        play.do({row.reporter: row.report(play, box=(0.25, 0.25, 0.75, 0.5))})
        assert [event.kind for event in play.events] == ["matched", row.located]
        assert play.events[0].evidence["iou"] == 0.5


@by_row
def test_a_report_must_name_the_class_of_the_target(row):
    assert judged(row, lambda play: row.report(play, cls="car")) == []


@pytest.mark.parametrize("row", RADIAL, ids=str)
@pytest.mark.parametrize(("beyond", "counts"), [(0.0, True), (-0.01, True), (0.01, False)])
def test_the_coordinate_is_accepted_within_the_radius_inclusively(row, beyond, counts):
    events = judged(row, lambda play: row.report(play, off=-(row.near_m + beyond)))
    assert events == (["matched", row.located] if counts else ["matched"])


@pytest.mark.parametrize(
    ("place", "counts"),
    [
        ((665.1, -1081.1), True),  # a corner of the region: on its edge is inside
        ((665.09, -1080.0), True),
        ((665.11, -1081.1), False),
        ((270.0, -740.0), False),
    ],
)
@pytest.mark.parametrize("row", [SSR, SSR_STAR], ids=str)
def test_at_sea_the_coordinate_is_accepted_within_the_rescue_region(row, place, counts):
    assert judged(row, lambda play: row.report(play, at=place)) == (["matched", "reported"] if counts else ["matched"])


@pytest.mark.parametrize(("aside", "counts"), [(6.0, True), (5.99, True), (6.01, False)])
def test_the_coordinate_of_a_leak_must_also_lie_in_the_region_of_the_pipe(aside, counts):
    def report(play):
        x, y, _ = play.entity("leak[1]").position
        assert x == 20.0, "this seed's leak is on the straight north-south run"
        return UPR.report(play, at=(x + aside, y))

    assert judged(UPR, report) == (["matched", "located"] if counts else ["matched"])


@by_row
def test_a_box_counts_only_for_the_picture_that_shows_it(row):
    """The target is elsewhere in the next picture. Its box there does not match in the previous picture."""
    with opened(row) as play:
        photograph(row, play)
        play.stage.boxes = {row.target: (0.1, 0.1, 0.3, 0.3)}
        play.do({row.reporter: does("takePhoto", camera="nadir")})
        play.do({row.reporter: row.report(play, tick=2, box=CENTRE_BOX)})
        play.do({row.reporter: row.report(play, tick=1, box=(0.1, 0.1, 0.3, 0.3))})
        assert play.kinds() == []
        play.do({row.reporter: row.report(play, tick=1, box=CENTRE_BOX)})
        assert [kind for kind, *_ in play.kinds()] == ["matched", row.located]


@by_row
def test_a_second_report_of_the_same_box_does_not_count(row):
    """A second report of the same box in the same picture is a false positive, whatever place it names."""
    wrong = (row.near_m or 0.0) + 0.01
    far = {"at": (-5000.0, 0.0)} if row.near_m is None else {"off": -wrong}
    assert judged(row, lambda play: row.report(play, **far), row.report) == ["matched"]


@by_row
def test_a_report_of_a_picture_without_the_target_gives_no_detection(row):
    with opened(row) as play:
        play.do({row.reporter: does("takePhoto", camera="nadir")})
        play.do({row.reporter: row.report(play)})
        assert play.kinds() == []
        assert play.published.evaluation.reward == 0.0


@by_row
def test_a_picture_that_was_never_taken_cannot_be_reported(row):
    with opened(row) as play:
        play.do({row.reporter: row.report(play, tick=7)})
        assert ("rejected", "bad_field") in play.reasons(row.reporter)
        assert play.kinds() == []


@by_row
def test_no_interaction_happens_without_a_valid_report(row):
    """The actor stands on the target from the start. Only a valid report unlocks its interaction."""
    with opened(row) as play:
        play.put(row.actor, row.target)
        play.wait(4)
        assert play.emitted() == play.kinds() == []
        photograph(row, play)
        play.do({row.reporter: row.report(play, cls="car")})
        play.wait(4)
        assert play.emitted() == play.kinds() == []


@by_row
def test_false_claims_unlock_no_interaction(row):
    """Status messages that claim success, and a report one centimetre too far, with the actor at the target."""
    with opened(row) as play:
        play.put(row.actor, row.target)
        photograph(row, play)
        lie = {"at": (-5000.0, 0.0)} if row.near_m is None else {"off": -row.near_m - 0.01}
        play.do({row.reporter: row.report(play, **lie)})
        kinds = {spec.kind: spec for spec in play.instance.messages}
        claim = next((kind for kind, spec in kinds.items() if spec.type == "status"), None)
        if claim is not None:
            role = kinds[claim].senders[0]
            sender = next(agent.id for agent in play.instance.agents if agent.role == role)
            play.do({sender: says(claim, task=row.interaction, state=row.executed)})
            assert ("accepted", "") in play.reasons(sender)
        play.wait(4)
        assert [kind for kind, *_ in play.kinds()] == ["matched"]
        assert play.emitted() == [] and not play.done


@by_row
@pytest.mark.parametrize(("beyond", "counts"), [(0.0, True), (-0.01, True), (0.01, False)])
def test_the_actor_interacts_within_its_radius_inclusively(row, beyond, counts):
    with opened(row) as play:
        photograph(row, play)
        play.do({row.reporter: row.report(play)})
        assert not play.done
        play.put(row.actor, row.target, east=-(row.reach_m + beyond))
        play.wait(5)
        assert play.emitted() == ([f"{row.interaction} {row.target}"] if counts else [])
        assert play.success is counts
        assert [kind for kind, *_ in play.kinds()] == ["matched", row.located, *([row.executed] if counts else [])]


@by_row
def test_detection_localisation_and_execution_are_separate_stages(row):
    """One after the other, at different boundaries: detected with a wrong place, located later, executed last."""
    with opened(row) as play:
        photograph(row, play)
        wrong = {"at": (-5000.0, 0.0)} if row.near_m is None else {"off": -row.near_m - 0.01}
        play.do({row.reporter: row.report(play, **wrong)})
        play.do({row.reporter: does("takePhoto", camera="nadir")})
        subject = row.target
        assert play.stages() == [f"detect {subject}"]
        play.do({row.reporter: row.report(play, tick=3)})
        assert play.stages() == [f"detect {subject}", f"locate {subject}"]
        play.put(row.actor, row.target)
        play.wait(5)
        assert play.stages()[-1] == f"execute {subject}"
        assert play.success


@pytest.mark.parametrize("row", [UFR, UFR_STAR, SSR, SSR_STAR], ids=str)
def test_success_requires_every_target(row):
    """With two targets, completing one gives half a score and no success."""
    other = row.target.replace("1", "2")
    with kit.playing(row.mission, row.mode, **({"fires": 2.0} if row.mission == "ufr" else {"victims": 2.0})) as play:
        play.stage.boxes = {row.target: CENTRE_BOX, other: (0.7, 0.7, 0.9, 0.9)}
        play.do({row.reporter: does("takePhoto", camera="nadir")})
        play.do({row.reporter: row.report(play)})
        play.put(row.actor, row.target)
        play.wait(3)
        assert play.published.evaluation.reward == 0.5 and not play.done
        second = reports(row.kind, "f1-uav[1]-nadir", row.cls, play.entity(other).position[:2], (0.7, 0.7, 0.9, 0.9))
        play.do({"scout[2]": second})
        play.put(row.actor, other)
        play.wait(3)
        assert play.success
