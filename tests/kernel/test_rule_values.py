"""Rules that read the sender and the time of a message, speed, battery and lines of sight in a played episode."""

from __future__ import annotations

from lingjing.testing import Stage, compiled, does, episode, says, together

TEXT = """ljs 2
use std.sea { lifeboat }
use std.air { quadrotor }
use std.messages { note }

mission yard "Yard" {
  goal "Wait."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 100 }
  mode broadcast
  asset boat : lifeboat { position = (10 m, -1350 m), heading = 30 deg }
  asset uav : quadrotor { position = (10 m, -1300 m, 40 m), actions { setDestination, stop } }
  agent skipper as rescuer controls boat { observes boat.*, events }
  agent pilot as scout controls uav { observes uav.*, events }
  message hello : note from rescuer, scout to all
  adjudicate by_skipper(r: hello) { when r.sender == skipper }
  adjudicate by_scout(r: hello) { when r.role == scout and r.sender in [pilot] }
  adjudicate early(r: hello) { when r.sent <= 10 s }
  adjudicate fresh(r: hello) { when now - r.sent <= 10 s }
  adjudicate seen() { when line_of_sight(uav, boat) and distance(uav, boat) > 60 m and distance_xy(uav, boat) < 55 m }
  adjudicate charged() { when uav.battery == 100 % }
  adjudicate still() { when speed(boat) == 0 m/s }
  success when now > 900 s
}
"""


def events_of(ticks: int) -> dict[str, list[int]]:
    """Rule → the ticks at which it became true, where both agents greet at every boundary."""
    ticks_of: dict[str, list[int]] = {}
    with episode(compiled(TEXT), seed=1, stage=Stage()) as play:
        for tick in range(ticks + 1):
            if tick > 0:
                hello = {name: says("hello", text="hi") for name in ("skipper", "pilot")}
                play.do({name: together(does("stop"), greeting) for name, greeting in hello.items()})
            for event in play.published.record.events:
                ticks_of.setdefault(event.kind, []).append(play.published.record.tick)
    return ticks_of


def test_rules_read_senders_times_speeds_and_lines_of_sight() -> None:
    ticks = events_of(4)
    assert ticks["by_skipper"] == ticks["by_scout"] == [1, 2, 3, 4]
    assert ticks["early"] == [1, 1, 2, 2]
    assert ticks["seen"] == ticks["still"] == [0]
    assert "charged" not in ticks, "the stand-in reports no battery, and a missing value makes nothing true"
    assert ticks["fresh"] == [1, 1, 2, 2, 3, 3, 4, 4]
