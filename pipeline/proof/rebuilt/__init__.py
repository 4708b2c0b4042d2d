"""What a bundle states, made again and compared."""
