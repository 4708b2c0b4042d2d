"""Pure plane and solid geometry: arrays and shapely in, arrays and shapely out."""
