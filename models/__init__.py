"""MJCF models: the car, the LiDAR, and a scene that opens in any MuJoCo viewer."""
