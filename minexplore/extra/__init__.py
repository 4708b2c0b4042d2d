"""What an environment works without: Warp, recordings, any MJCF robot, Stable-Baselines3, and corpora.

Nothing of the rest of `minexplore` imports it, but what chooses it by name: `minexplore` itself, `backends` and the
command.
"""
