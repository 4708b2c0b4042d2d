"""What all baselines use: errors, environments, results files, statistics."""
