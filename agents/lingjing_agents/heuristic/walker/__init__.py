"""Rules of agents that command a walking body.

`rules` chooses one of three at the first boundary:

- `navigator`   reads records of category `assignment` (where to go); finds the building of its reference picture
- `searcher`    sends and reads `report` and `target_status`; looks for fires, which `fires` keeps, and waits by them
- `executor`    reads `assignment` records with a step, sends `target_status` (how the step ended); has no camera

They share how to move and how to look:

- `legs`        a goal → the next turn or step ← `way` (the way kept) ← `plan` (the way of fewest commands)
- `occupancy`   where something stands: bumped into, or seen
- `views`       which ground has been seen, and from where to look next
- `facade`, `flames`, `walls`   what a front picture shows: a building, a fire, what stands close ahead

In: observations and inboxes. Out: decisions of one agent. Invariant: only colours and depths are looked at.
"""
