"""The LiDAR: its beams, read off its MJCF, two ways to measure along them, and what a real sensor adds.

`beams` has LidarModel, one MJCF file of a LiDAR. `lidar` has the two back ends: MuJoCo's rangefinders, and a scanline
z-buffer (`scanline`) over triangle clusters (`clusters`, prepared in `visible_surfaces`, skipped by `culling`).
`surfaces` lists what beams can meet in a model, and `body_poses` says where it is.
`effects` adds noise, dropouts, latency and the LiDAR's motion during a scan. The room knows of no vehicle: a LiDAR can
stand on any body.
"""
