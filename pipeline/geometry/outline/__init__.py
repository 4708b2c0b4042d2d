"""From pixels or lines to the outline of the workings."""
