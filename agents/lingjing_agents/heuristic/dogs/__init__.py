"""Rules of agents that command a walking body, which turns by degrees and steps by metres.

`dog_rules` chooses one of three at the first boundary:

- `building_finder`   goes where an assignment says or as guidance leads; finds the building of its reference picture
- `fire_searcher`     looks for fires, which `known_fires` keeps, and stands beside them until they are out
- `step_executor`     has no camera: takes the steps that guidance names

They share `movement` (a goal → the next turn or step, over `paths`) and `seen_ground` (which ground pictures have
shown, and from where to look next).
"""
