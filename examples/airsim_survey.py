"""An AirSim script: fly lanes over a rectangle, and take a picture straight down at each end.

Start a city first: `lingjing serve --airsim --scene bay`. The client is the package `cosysairsim`.
"""

import argparse
from pathlib import Path

import cosysairsim as airsim

parser = argparse.ArgumentParser()
parser.add_argument("--port", type=int, default=41451)
parser.add_argument("--output", default="survey")
args = parser.parse_args()
folder = Path(args.output)
folder.mkdir(exist_ok=True)

client = airsim.MultirotorClient(port=args.port)
client.confirmConnection()
client.enableApiControl(True)
client.armDisarm(True)
client.takeoffAsync().join()

HEIGHT, LENGTH, LANES, APART, SPEED = 25, 40, 3, 15, 8
for lane in range(LANES):
    ends = (0, LENGTH) if lane % 2 == 0 else (LENGTH, 0)
    for x in ends:
        client.moveToPositionAsync(x, lane * APART, -HEIGHT, SPEED).join()
        scene, depth = client.simGetImages(
            [
                airsim.ImageRequest("bottom_center", airsim.ImageType.Scene),
                airsim.ImageRequest("bottom_center", airsim.ImageType.DepthPerspective, True, False),
            ]
        )
        airsim.write_file(str(folder / f"lane{lane}_{x}.png"), scene.image_data_uint8)
        print(f"lane {lane}, north {x} m: nearest {min(depth.image_data_float):.1f} m below")

client.moveToPositionAsync(0, 0, -HEIGHT, SPEED).join()
client.landAsync().join()
