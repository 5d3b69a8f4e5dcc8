"""Rules of agents that command a walking body, which turns by degrees and steps by metres.

`dog_rules` selects one of three at the first boundary:

- `building_finder`: goes to an assigned place or along guidance; finds the building of its reference picture
- `fire_searcher`: searches for fires (`known_fires`) and stands beside them until they are out
- `step_executor`: has no camera and carries out guided steps

They share `movement` (from a goal to the next turn or step, over `paths`) and `seen_ground` (the photographed ground
and the next place for a picture). `timely_stages` reads how near to every place a searcher must come in time.
"""
