"""How hard the mines are: classical explorers, an upper bound, PPO, and the protocol that compares them."""
