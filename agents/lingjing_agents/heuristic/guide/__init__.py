"""Rules of agents that fly and lead a walker which does not see what it looks for.

- `pilot`    finds a leak, sends it as a `report`, then leads with `guidance`: one step of the walker at a time; reads
  `target_status` (how the step ended)
- `leak`     leaks in pictures from above
- `ground`   what stands on the ground, from a depth picture, as closed cells of a walker's map
- `home`     leads to the building of a reference picture; what `heuristic.homes` finds in pictures from above

In: observations and inboxes. Out: decisions of one agent. Invariant: only colours and depths are looked at.
"""
