"""What can go wrong, said once: every message names the thing, the value and the limit."""


class MineError(Exception):
    """Base of all expected failures; a command that meets one prints it and exits with code 2."""


class InputError(MineError):
    """A file from outside (plan, scale bar, survey, poses) cannot be used."""


class ParamsError(MineError):
    """An override or a configuration value is unknown or out of range."""


class GeometryError(MineError):
    """A geometric precondition or invariant does not hold."""


class ArtifactError(MineError):
    """An artifact is missing, broken or not the one its manifest names."""


class LimitError(MineError):
    """A measured value breaches its limit in `conf/validation`."""
