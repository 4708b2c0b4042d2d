"""The mesh on which floors are solved: edges along legs, where walls are steps between floors, ledges that are cut."""
