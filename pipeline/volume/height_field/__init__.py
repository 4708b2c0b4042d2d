"""The floors of drivable legs as height fields seen from above, and the solids that they make."""
