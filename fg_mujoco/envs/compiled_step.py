"""The table of the arrays of a step of an environment: actions in, rewards and observations out.

native/envs/compiled_step.cpp does a step as one call. The rows of the episodes are those of the cars that learn: every
`stride`-th row of the engine's arrays.
"""

NAMES = (
    "running", "timers", "crashed", "reasons", "telemetry", "held", "odometry", "ranges",
    "driven", "commands", "clipped", "limits", "planned", "targets", "previous",
    "progress", "wrecked", "impacts", "before", "sliding", "weights", "rewards", "terms",
    "contacts", "touched_at", "began", "beams", "columns", "low", "high", "numbers",
)  # fmt: skip
"""Of the arrays in a table. The first line are the engine's, of all cars; `held` are its commands, `odometry` its
numbers (r, k). The others are arguments of `read_actions`, `reward_ticks` and `read_sensors`, (n,) for the cars that
learn; `contacts`, `touched_at` and `began` are those of Contacts, (r,) for all cars; `numbers` are `stride`, `share`,
`slow`, `reward_share`, `alone`, `range_max`, `substeps` and `on_contact`."""
