"""The six stages, one declaration each; `python -m stages.NAME [OVERRIDE ...]` runs one."""

import pipeline as pipeline  # first, so that it can report missing packages
