"""Rules of agents that fly and lead a walking body which does not see what it is to find, by `guidance` messages.

- `to_leak`       finds a leak, reports it, then sends one step at a time
- `to_building`   leads to the building of a reference picture by a whole path at once
"""
