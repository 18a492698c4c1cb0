"""Rollouts: many worlds, each drawn from its own seed, driven in threads or on a Ray cluster.

`rollouts` has rollout, and `result` its RolloutResult. `randomization` draws the parameters of a world from its seed.
`job` cuts the worlds into chunks, `world_batch` drives the worlds of a chunk by one engine, and `local` and
`ray_cluster` say where chunks are driven. `store` keeps finished chunks, in memory or in a folder.
"""
