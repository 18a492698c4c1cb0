"""Learning environments: the same episodes behind dm_env, Gymnasium and Gymnasium's vector interface.

`dm_environment`, `gym_environment` and `gym_vector` are the three interfaces. `episodes` has what they share: actions
in; observations, rewards and ends out. It drives the cars of `worlds`, one or many. `actions`, `observations` and
`rewards` say what a policy commands, sees and gets, `starts` where an episode begins, and `environment_settings` which
of these can be set. `reward_kernels` has the compiled loops, and `rendering` pictures of an episode.
"""
