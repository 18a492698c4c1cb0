"""The command line `fg-mujoco`: the nine commands of the core, and the parser for those of add-ons, too.

`main` builds the parser and knows the commands. `command` makes a command of a function and its options, and `options`
reads the options of a Setup from its fields. `race` has `race` and `replay`, `lists` has `controllers` and `vehicles`;
`drive`, `friction`, `render`, `rollout` and `track` have the commands of those names. `config` reads `--config`, `out`
chooses the folder of `--out`, `progress` shows how far something is, `completion` answers the shell, and `words` knows
what newcomers type.
"""
