"""What the process that forks commands imports for them (see `tests.forked`): parsed sources, from which stages hash."""

from pipeline.store.hashing import import_closure
from stages.__main__ import STAGES
from tests.project import ROOT

for _name in STAGES:
    import_closure(ROOT / "stages" / f"{_name}.py", ROOT)  # it keeps what it has parsed
