"""Where bodies go: paths around obstacles, orders of visits and tours; shared by the oracle and the heuristic policies.

- `grid_search`       the one search over grids (A*), which both kinds of maps below use
- `obstacle_grid`     what a dog has bumped into or seen, and the shortest path around it (A*)
- `kept_path`         keeps a path as long as it is open
- `fewest_commands`   the path that takes a dog the fewest turns and steps over ground seen from above
- `clearance_paths`   paths over a map that says how far the next obstacle is
- `visiting_order`    shortest orders of a few places, shares of several bodies
- `delivery_tours`    which stops one load serves, and in which order
"""
