"""What environments do from tick to tick, for tests."""


def commands_of_ticks(env):
    """Return a list that gets the commands [rad, m/s] of each tick that an F1TenthEnv drives from now on."""
    episodes, commands = env._episodes, []
    tick = episodes.tick

    def ticking(actions, **options):
        tick(actions, **options)
        commands.append(episodes.commands[0].copy())

    episodes.tick = ticking
    return commands
