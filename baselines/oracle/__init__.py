"""What no robot can beat in a world, and a tour that is driven on its known map: the truth lies between."""
