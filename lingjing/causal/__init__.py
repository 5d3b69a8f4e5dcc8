"""Causal analysis of episodes: replay, branches with interventions, blame, values of messages, shrinking.

A *replay* runs the recorded decisions of a trace on fresh engines and compares the digests. A *branch* is a fork of
the episode at a boundary that is played on with a change, under common random numbers. A *null fork* is a branch
without a change; it must equal the trace. An *intervention* is such a change: a *substitution* replaces a *faculty* of
an agent (perception, localisation, waypoint, routing, handoff, execution) by the decision of its *reference*, a
privileged policy that observes the ground truth; a message change drops, delays or forges a message. An agent
*departs* from its reference at a boundary where their decisions differ in a faculty, and *agrees* with it where they
are equal. A *pair* is a faculty and its agent. A *repair* is a set of pairs that wins a lost episode when it is
substituted. A *placebo* is a branch that should not win.

- `recorded`  the recorded decisions on fresh engines, boundary by boundary; the other modules use it
- `replay`    the comparison with the trace ← `picture_comparison` (recorded and new pictures)
- `faculties` the parts of a decision that belong to each faculty, and their replacement
- `references`, `interventions`   the references of agents, and the changes of a branch
- `redriven`  an episode with its policies in one process, ready to be forked
- `shared_camera` ← `branch_pictures`, `picture_memory`   one renderer for all branches
- `branching` one branch in a forked process
- `branch_host` → `branch_process` → `branch_queue`   the client of the branch server, the server, and its workers
- `blame`     the search for repairs ← `repairing_sets` (the pairs), `departures`, `later_starts` (the first boundary),
  `branch_budget`, `narrowing` (the window), `shapley` (shares), `placebos` (chance)
- `message_value`  the value of each message
- `shrink`    the smallest mission that fails alike ← `failure` (equality of failures), `reduced_mission` (removal of
  parts), `delta_debugging` (the search), `candidates` (playing)
- `redraw`    pictures that no agent requested, rendered from the states of a trace
- `result_texts`, `processor_time`   results as text, and CPU time of processes
"""
