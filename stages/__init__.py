"""The six stages, one declaration each; `python -m stages.NAME [OVERRIDE ...]` runs one."""

import pipeline as pipeline  # first: it says what is missing when the environment is not the project's
