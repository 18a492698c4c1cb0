"""Rollouts: many worlds, each drawn from its own seed, driven in threads or on a Ray cluster.

`rollouts` has rollout, and `rollout_result` its RolloutResult; `racing.randomization` draws the parameters of a world.
`job` cuts the worlds into chunks, `drive_worlds` drives the worlds of a chunk by one engine, and `local` drives the
chunks; on a Ray cluster the add-on learn does. `chunk_store` keeps finished chunks, in memory or in a folder.
`recording` has what is recorded of each tick; the add-on learn reads recorded scans as data sets. `workers` runs
processes, and `store` keeps finished parts in a folder; studies of add-ons use both.
"""
