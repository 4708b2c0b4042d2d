"""What a world bundle may hold: an allow-list of files, record fields, elements, attributes and values.

`certify`, `export`, `verify` and stage 6 apply it to every bundle, after `minexplore` has opened it; see
`docs/security.md`. Everything that is not listed is refused, with its path in the file. `model.py` is the table of
`mine.xml` (`light.py` without visible rock), `record.py` that of `world.json`, `files.py` that of the folder;
`agreement` compares the three.
"""

from pipeline.schema.world import check_tables, check_world

__all__ = ["check_tables", "check_world"]
