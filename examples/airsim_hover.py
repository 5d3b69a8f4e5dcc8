"""An AirSim script: take off, hover, turn, fly a square, land.

Start a city first: `lingjing serve --airsim --scene bay`. The client is the package `cosysairsim`.
"""

import argparse

import cosysairsim as airsim

parser = argparse.ArgumentParser()
parser.add_argument("--port", type=int, default=41451)
args = parser.parse_args()

client = airsim.MultirotorClient(port=args.port)
client.confirmConnection()
client.enableApiControl(True)
client.armDisarm(True)

client.takeoffAsync().join()
client.hoverAsync().join()
client.rotateToYawAsync(90).join()

for vx, vy in ((4, 0), (0, 4), (-4, 0), (0, -4)):
    client.moveByVelocityZAsync(vx, vy, -8, 4).join()
    position = client.getMultirotorState().kinematics_estimated.position
    print(f"north {position.x_val:.1f} m, east {position.y_val:.1f} m, down {position.z_val:.1f} m")

client.moveToPositionAsync(0, 0, -8, 5).join()
client.landAsync().join()
client.armDisarm(False)
client.enableApiControl(False)
