"""Formats in longitude and latitude of the earth: KML, KMZ and GPX."""
