"""Learning environments: the same episodes for dm_env, Gymnasium, Gymnasium's vector interface and PettingZoo.

`dm_environment`, `gym_environment`, `gym_vector` and `pettingzoo_environment` are the interfaces. They share
`episodes`: actions in; observations, rewards and ends out. Episodes drive the cars of `worlds`. `actions`,
`observations`, `rewards` and `end_conditions` describe the policy's side. Their own terms are functions of
`tick_state`. `starts` places the cars, and `environment_settings` has all settings. `reward_kernels` has the
compiled loops, and `rendering` draws pictures.
"""
