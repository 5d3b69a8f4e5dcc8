"""Episodes run again from their traces: what was decided, what nobody saw, what did not happen.

- `recorded`  `RecordedRun`: the recorded decisions on fresh engines, boundary by boundary; all else here is built on it
- `replay`    whether they lead to the states that the trace holds, or what differs first
- `shrink`    the smallest mission that fails as a trace did: `failure` says when two failures are the same,
  `reduced_mission` leaves parts out, `delta_debugging` chooses them, `candidates` plays what is left
- `lookback`  pictures that no agent asked for, drawn from the states that a trace holds
"""
