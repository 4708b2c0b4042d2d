"""How parameters are read, and how a refusal names them."""
