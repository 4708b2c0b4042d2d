"""Stage 1's readers: plan images, station surveys, scale bars, surveyed poses; and the fetcher of the real data."""
