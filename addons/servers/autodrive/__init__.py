"""AutoDRIVE, whose simulator the RoboRacer Sim Racing League races in: its topics in bags, and its bridge to a DevKit.

`topics` says what the bridge's topics mean. A DevKit is a server of Socket.IO that a simulator connects to: `socket_io`
is that connection, `packets` has what goes over it, and `devkit` makes a planner of a DevKit, for `fg-mujoco serve`.
"""
