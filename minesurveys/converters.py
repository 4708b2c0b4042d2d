"""Files that are not read: which program turns each into a format that is."""

from __future__ import annotations

_MODEL = "saves the surface of the workings as .obj, .stl, .ply, .glb, .dae or .usdc"
_LASER = "exports the scans as .e57, .ptx or .laz"
_OGR = "QGIS exports it as GeoPackage, or `ogr2ogr out.gpkg` and its name"

CONVERTED: dict[str, str] = {
    # Surveys of caves
    **dict.fromkeys((".top",), "PocketTopo exports it as text, which Therion's editor imports; give the .th"),
    **dict.fromkeys((".tro", ".trox"), "VisualTopo exports it for Survex or Therion: give the .svx or .th"),
    **dict.fromkeys((".csx", ".csz"), "cSurvey exports it for Survex or Therion: give the .svx or .th"),
    **dict.fromkeys((".tdr", ".tdz", ".cave"), "TopoDroid exports it for Survex or Therion: give the .svx or .th"),
    ".pos": "stations without legs; give the .3d that Survex wrote with it",
    ".err": "what Survex prints of loops; give the .svx or the .3d",
    ".plf": "Compass writes the same plot as .plt",
    ".wrl": "Therion and Blender write it; give the .lox or .3d of the survey, or save the mesh as .obj or .ply",
    **dict.fromkeys((".th2", ".xvi"), "a drawing of Therion without a survey; give the .th file that inputs it"),
    # Drawings
    **dict.fromkeys((".dwg", ".dgn", ".dwf"), "the CAD program saves it as .dxf"),
    **dict.fromkeys((".svg", ".ai", ".eps"), "Inkscape exports it as .pdf, or its lines as .dxf"),
    **dict.fromkeys((".jp2", ".webp", ".heic", ".avif", ".psd", ".ecw", ".sid"), "an image program saves it as .png"),
    **dict.fromkeys((".pgm", ".ppm", ".pbm"), "give the .yaml of the map beside it; a plan is saved as .png"),
    **dict.fromkeys(
        (".doc", ".docx", ".odt", ".odg", ".vsd", ".vsdx"), "the program that made it exports the plan as .pdf"
    ),
    # Tables
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "a table of stations is saved as .csv"),
    ".tsv": "a table of stations is saved as .csv, with the names of its columns first",
    # Geographic data
    **dict.fromkeys((".gml", ".tab", ".mif", ".gdb", ".e00", ".adf", ".sqlite", ".osm", ".pbf"), _OGR),
    **dict.fromkeys(
        (".fgb", ".geojsonl", ".topojson", ".qgz", ".qgs", ".mbtiles", ".loc"),
        "QGIS exports a layer as GeoPackage or GeoJSON",
    ),
    # Mine planning
    **dict.fromkeys((".00t", ".00g"), "Vulcan exports the triangulation as .dxf or .obj"),
    **dict.fromkeys((".isis",), "Vulcan exports the layers as .dxf"),
    **dict.fromkeys((".dm", ".dmx"), "Datamine exports the wireframe or the strings as .dxf"),
    **dict.fromkeys(
        (".dmp", ".duf", ".dcf"), "the planning program (Deswik, Micromine) exports the solid as .dxf or .obj"
    ),
    **dict.fromkeys((".lfm", ".lfview", ".msh"), "Leapfrog exports the mesh as .obj, .stl or .omf"),
    **dict.fromkeys(
        (".ts", ".vs", ".so", ".vo"),
        "GOCAD's own objects: SKUA-GOCAD or Geoscience ANALYST saves the surface as .dxf or .obj",
    ),
    **dict.fromkeys(
        (".geoh5", ".omf2"), "the program that made it exports the surface as .obj, or as .omf of version 1"
    ),
    # Meshes
    **dict.fromkeys(
        (".3ds", ".blend", ".c4d", ".fbx", ".gltf", ".lwo", ".ma", ".max", ".mb", ".usdz", ".x3d"),
        f"Blender, or the program that made it, {_MODEL}",
    ),
    **dict.fromkeys((".off", ".3mf", ".amf"), "MeshLab, or for .3mf and .amf PrusaSlicer, saves it as .stl or .obj"),
    **dict.fromkeys((".skp", ".3dm"), f"SketchUp or Rhino {_MODEL}"),
    **dict.fromkeys(
        (".ifc", ".rvt", ".rfa", ".nwd", ".nwc", ".step", ".stp", ".iges", ".igs", ".sldprt", ".x_t", ".sat", ".jt"),
        f"the program that made it, or FreeCAD, {_MODEL}",
    ),
    **dict.fromkeys((".vtk", ".vtp", ".vtu"), "ParaView saves the surface as .ply or .stl"),
    ".mtl": "colours of an .obj; give that file",
    # Scans
    **dict.fromkeys((".rcp", ".rcs"), f"Autodesk ReCap {_LASER}"),
    **dict.fromkeys((".fls", ".fws", ".lsproj"), f"FARO SCENE {_LASER}"),
    **dict.fromkeys((".zfs", ".zfprj"), f"Z+F LaserControl {_LASER}"),
    **dict.fromkeys((".imp", ".lgs", ".ptg"), f"Leica Cyclone {_LASER}"),
    **dict.fromkeys((".rxp", ".rdbx"), f"RiSCAN PRO {_LASER}"),
    **dict.fromkeys((".dp", ".tzf", ".tzs", ".cl3", ".clr"), f"the scanner's own program {_LASER}"),
    **dict.fromkeys(
        (".bin", ".sbf", ".bpf", ".npy", ".npz", ".mat"), "CloudCompare saves the cloud as .laz, .ply or .e57"
    ),
    **dict.fromkeys(
        (".7z", ".rar", ".gz", ".tar", ".tgz", ".bz2", ".xz"), "unpack it, and give the file of the survey"
    ),
    # Robots
    **dict.fromkeys(
        (".bag", ".db3", ".mcap", ".pbstream", ".posegraph"),
        "a recording or a state of a robot; save its map by `map_saver_cli`, and give the .yaml",
    ),
    ".db": "a map of RTAB-Map: rtabmap-export writes its points as .ply",
    **dict.fromkeys(
        (".world", ".sdf", ".urdf", ".mjcf"), "a world for a simulator; give the mesh of the rock that it names"
    ),
}
