"""What each command of `tests.forked` would do anew: read the grammar of overrides, and the imports of all stages."""

import gc

from pipeline.store.hashing import import_closure
from stages.__main__ import STAGES
from tests.composed import compose
from tests.project import ROOT

for _name in STAGES:
    import_closure(ROOT / "stages" / f"{_name}.py", ROOT)  # it keeps what it has parsed

compose(["look=dry"])  # the grammar of overrides takes as long to read as a configuration to compose

gc.collect()
gc.freeze()  # a collection in a forked command would copy every page that it looks at
