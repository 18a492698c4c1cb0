"""The LiDAR: its beams, read off its MJCF, two ways to measure along them, and what a real sensor adds.

`beams` has LidarModel, one MJCF file of a LiDAR. `lidar` has the two back ends: MuJoCo's rangefinders, and a scanline
z-buffer (`scanline`) over what `visible_surfaces` finds in a model, in `clusters`. `effects` adds noise, dropouts,
latency and the LiDAR's motion during a scan. A LiDAR can stand on any body. Loops over beams and surfaces are in the
native core: native/lidar in the repository.
"""
