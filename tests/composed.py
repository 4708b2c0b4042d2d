"""Configurations of this checkout, wherever a test works: composing one takes a quarter of a second."""

from functools import cache

from pipeline.compose import compose as compose_anew
from pipeline.params.config import Config
from pipeline.places import CONF
from tests.project import ROOT


def compose(overrides: list[str]) -> Config:
    """Return the configuration with overrides, composed once in a process; each caller has its own."""
    return _composed(tuple(overrides)).model_copy(deep=True)


@cache
def _composed(overrides: tuple[str, ...]) -> Config:
    return compose_anew(list(overrides), ROOT / CONF)
