"""Many pieces of work: over the processors of this machine, or over a cluster of Ray."""
