"""Motion planning: paths around obstacles, orders of visits and tours, for the oracle and the heuristic policies.

- `grid_search`: the search over grids (A*), which both kinds of maps below use
- `obstacle_grid`: the obstacles that a walker has met or seen, and the shortest path around them
- `kept_path`: a path that is kept as long as it is open
- `fewest_commands`: the path with the fewest turns and steps over ground seen from above
- `clearance_paths`: paths over a map of the distance to the next obstacle
- `between_towers`: flights around the buildings that rise above their height
- `visiting_order`: shortest orders of a few places, assignment of places to several bodies
- `delivery_tours`: the stops of each load and their order
"""
