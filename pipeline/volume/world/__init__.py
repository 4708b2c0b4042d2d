"""A volume as a world: what the bundle's files hold, how stages 3 and 5 make them, and the certificate of stage 6."""
