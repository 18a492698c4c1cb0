"""The exception tree. Every message says what was wrong, where it came from, and what would be accepted."""


class FgMujocoError(Exception):
    """Anything this package refuses; the command line prints it in one line and exits 2."""


class MessageError(FgMujocoError, ValueError):
    """A scan, command or odometry message with a value that no sensor or actuator has."""


class SettingsError(FgMujocoError, ValueError):
    """A setting outside its accepted range, or a combination that cannot work."""


class TrackError(FgMujocoError, ValueError):
    """A track that cannot be read, or that no car can drive."""


class ModelError(FgMujocoError, ValueError):
    """An MJCF model that lacks a part the simulation needs, or has one it cannot represent."""


class ControllerError(FgMujocoError):
    """A controller that cannot be loaded, cannot be built, or answers something else than a command."""


class RunFolderError(FgMujocoError, OSError):
    """A run folder that cannot be written, or is not one."""


class BagError(FgMujocoError, OSError):
    """A bag that cannot be read or written, or a message in it that cannot be what it says."""


class MissingExtraError(FgMujocoError, ImportError):
    """An optional part that is not installed; the message is the command that installs it."""


class EngineError(FgMujocoError, RuntimeError):
    """A part of the machinery that fails: MuJoCo's engine, or a cluster that cannot be reached or lost what it had."""
