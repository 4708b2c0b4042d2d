"""What the shell's parts are made of: polygons of facets, shapes behind them, and what tests them."""
