"""What `python -m pipeline` does: each module declares its commands by `add_to`."""
