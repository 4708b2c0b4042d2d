"""How hard the mines are: classical explorers, an upper bound on coverage, PPO, and the protocol that compares them."""
