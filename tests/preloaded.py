"""Parsed sources, whose imports each stage follows for its hash: kept for all commands that `tests.forked` runs."""

import gc

from pipeline.store.hashing import import_closure
from stages.__main__ import STAGES
from tests.project import ROOT

for _name in STAGES:
    import_closure(ROOT / "stages" / f"{_name}.py", ROOT)  # it keeps what it has parsed

gc.collect()
gc.freeze()  # a collection in a forked command would copy every page that it looks at
