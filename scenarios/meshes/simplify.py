"""Simplifies the meshes of robots that ship: python simplify.py ROBOTS OUT, with ROBOTS the folder `robots` of example-robot-data 6.0.

Of each mesh the outer skin is kept, with some hundred triangles and without colours, as a GLB. Needs trimesh, pycollada, scikit-image and
fast-simplification.
"""

import sys
from pathlib import Path

import numpy
import trimesh

# The skin's cubes, metres, and the triangles that are left of it.
PITCH_M = 0.002
MOST = 700
# Faces that meet at a smaller angle than this are drawn as one smooth surface.
SMOOTH = numpy.radians(40)

SOURCES = {
    "panda": "panda_description/meshes/visual/*.dae",
    "ur10/collision": "ur_description/meshes/ur10/collision/*.stl",
}


def skin(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The outer surface: what is inside, screws and all, is filled."""
    cubes = mesh.voxelized(PITCH_M).fill()
    found = cubes.marching_cubes
    # In cubes from the first one's centre on, by trimesh's word.
    found.apply_transform(cubes.transform)
    trimesh.smoothing.filter_taubin(found, iterations=12)
    return found.simplify_quadric_decimation(face_count=MOST)


def simplified(path: Path) -> trimesh.Trimesh:
    mesh = trimesh.load(path, force="mesh")
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    mesh.merge_vertices(digits_vertex=6)
    small = mesh if len(mesh.faces) < 2 * MOST else skin(mesh)
    shaded = trimesh.graph.smooth_shade(small, angle=SMOOTH)
    off = numpy.abs(shaded.bounds - mesh.bounds).max()
    print(f"{path.stem}: {len(mesh.faces)} triangles, {len(shaded.faces)} left; its box is off by {1e3 * off:.1f} mm")
    return trimesh.Trimesh(shaded.vertices, shaded.faces, vertex_normals=shaded.vertex_normals, process=False)


robots, out = map(Path, sys.argv[1:])
for robot, pattern in SOURCES.items():
    (out / robot).mkdir(parents=True, exist_ok=True)
    for path in sorted(robots.glob(pattern)):
        (out / robot / f"{path.stem}.glb").write_bytes(simplified(path).export(file_type="glb", include_normals=True))
