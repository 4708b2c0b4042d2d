"""What a world bundle may hold beside its model: an allow-list of files and of the fields of `world.json`.

`certify`, `export`, `verify` and stage 6 apply it to every bundle, after `minexplore` has opened it; see
`docs/security.md`. Everything that is not listed is refused, with its path in the file. `record.py` is the table of
`world.json`, `files.py` that of the folder. No table describes `mine.xml`: it is made again and compared.
"""

from pipeline.schema.world import check_tables, check_world

__all__ = ["check_tables", "check_world"]
