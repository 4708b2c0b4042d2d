"""PPO on RLlib: settings, the environment it trains in, training, and what is kept of it."""
