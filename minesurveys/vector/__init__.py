"""Vector files: DXF, GeoJSON, GeoPackage and Shapefile, as shapes in metres."""
