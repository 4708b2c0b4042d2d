"""Commands of `python -m pipeline`. Each module declares its commands in `add_to`."""
