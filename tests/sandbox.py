"""Whether this system starts sandboxes: policies of others are tested where it does."""

import pytest

from baselines.base.errors import BaselineError
from baselines.sandbox.bubblewrap import require_sandbox


def _missing() -> str:
    try:
        require_sandbox()
    except BaselineError as error:
        return str(error)
    return ""


needs_sandbox = pytest.mark.skipif(bool(_missing()), reason=_missing() or "this system starts sandboxes")
