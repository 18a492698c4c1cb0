"""Learning environments: the same episodes for dm_env, Gymnasium and Gymnasium's vector interface.

`dm_environment`, `gym_environment` and `gym_vector` are the interfaces; the add-on learn has PettingZoo's. They share
`episodes`: actions in; observations, rewards and ends out. Episodes drive the cars of `worlds`. `actions`,
`observations`, `rewards` and `end_conditions` describe the policy's side. Their own terms are functions of
`tick_state`. `starts` places the cars, and `environment_settings` has all settings. `reward_kernels` has the
compiled loops, `compiled_step` a step as one call, and `rendering` draws pictures.
"""
