"""What a world bundle may hold: an allow-list of files, record fields, elements, attributes and values.

A world from a stranger is read by this package before MuJoCo sees it. Everything that is not listed is refused, with
its path in the file. `model.py` is the table of `mine.xml` (`light.py` without visible rock), `record.py` that of
`world.json`, `files.py` that of the folder; `agreement.py` compares the three.
"""

from minexplore.schema.world import CheckedWorld, check_files, check_world, hash_files, read_folder

__all__ = ["CheckedWorld", "check_files", "check_world", "hash_files", "read_folder"]
