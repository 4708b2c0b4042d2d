"""Parsed sources, whose imports each stage follows for its hash: kept for all commands that `tests.forked` runs."""

from pipeline.store.hashing import import_closure
from stages.__main__ import STAGES
from tests.project import ROOT

for _name in STAGES:
    import_closure(ROOT / "stages" / f"{_name}.py", ROOT)  # it keeps what it has parsed
