"""Worlds that come as files, from anywhere: what is checked of a bundle before anything reads it.

`files` has the names and the sizes, `world` the hashes, `record` the numbers of `world.json` that an environment uses,
`model` the names in `mine.xml`, and `volume` the arrays of a world that is one volume. What else a bundle of this
project's builder holds, value by value, `python -m pipeline certify` compares.
"""
