"""The drift network along the skeleton of the workings."""
