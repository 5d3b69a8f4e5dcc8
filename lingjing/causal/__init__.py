"""Episodes run again from their traces: what was decided, what nobody saw, what did not happen.

- `recorded`  `RecordedRun`: the recorded decisions on fresh engines, boundary by boundary; all else here is built on it
- `replay`    whether they lead to the states that the trace holds, or what differs first; `picture_comparison` says
  which pictures drawn anew differ from the trace's
- `shrink`    the smallest mission that fails as a trace did: `failure` says when two failures are the same,
  `reduced_mission` leaves parts out, `delta_debugging` chooses them, `candidates` plays what is left
- `faculties` which record of a decision each faculty makes, and how the truth replaces it
- `references` what would have been right, by a privileged policy; `interventions` what a branch changes
- `redriven`  an episode with its policies in one process, to be forked; `shared_camera` draws for all branches,
  each picture once (`branch_pictures`, `picture_memory`)
- `branching` one branch, in a fork; `branch_process` holds boundaries and forks, as `branch_queue` has it, so many at a
  time and some ahead ← `branch_host`, its caller's end
- `blame`     the search for what repairs: `repairing_sets` (which; of `departures`, from `beginnings` on, within a
  `branch_budget`), `narrowing` (when), `shapley` (shares), `placebos` (luck)
- `message_value`  what was worth saying
- `result_texts`   all of that in words; `processor_time` what a process has cost
- `lookback`  pictures that no agent asked for, drawn from the states that a trace holds
"""
