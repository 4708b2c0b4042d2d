"""The six stages, one declaration each; `python -m stages.NAME [OVERRIDE ...]` runs one."""
