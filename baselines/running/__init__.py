"""Episodes by the protocol, in one process or several."""
