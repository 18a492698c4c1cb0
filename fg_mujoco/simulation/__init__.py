"""The simulation: a course, a vehicle and a LiDAR become one MjModel, and the engine steps n worlds of it.

`world` compiles the model. `engine` has Engine, with the five verbs place, sense, decide, drive and judge. It uses
`sensing` (sensors and effects of LiDARs that take Python), `slots` (worlds that come and go, and their threads),
`physics` (MuJoCo's batch functions), `clear_ground` (where a car touches nothing), `compiled_tick` (what a tick and its
physics steps are told), `planner_adapter` (scans to planners, commands back), `termination` (the race monitor: laps,
and when a race ends) and `telemetry` (a row a tick, running statistics). native/simulation, of the native core, does
what these tell: it senses, drives and judges.
`simulation` has Simulation, one world that is stepped by hand. `settings` has the settings that races, rollouts,
environments and the live view share. `course_loading` loads courses for the default vehicle, and `mujoco_import`
imports MuJoCo where MUJOCO_GL names a library that is missing.
"""
