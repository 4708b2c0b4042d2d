"""What robots sense: beams, ranges and cells seen."""
