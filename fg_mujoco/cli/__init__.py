"""The command line `fg-mujoco`: one module for each command or small group of commands.

`main` builds the parser and has `race`, `replay` and `controllers`. `track`, `rollout`, `compare`, `render`, `report`,
`view` and `friction` have the commands of those names, and `bags` has `export` and `replay-scans`. `options` turns
texts into values, and `config` reads the settings of a race from a file.
"""
