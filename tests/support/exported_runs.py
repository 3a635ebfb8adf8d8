"""Runs that are exported: two sewn panels with texture, a still and a moving body; a reader of glTF animations."""

import numpy as np

from clothsim import Scene, simulate

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""(x, y, z) of a scene with z up as (x, z, -y)."""


def panels_obj(offset=(0.0, 0.0, 0.0)):
    """Two squares of 3 x 3 vertices side by side in space, apart in their texture; 18 vertices, 16 triangles."""
    lines, texture, count = [], [], 0
    for panel, (name, start) in enumerate((("left", 0.0), ("right", 0.2))):
        lines.append(f"g {name}")
        for i in range(3):
            for j in range(3):
                x, y = start + 0.1 * i, 0.1 * j
                lines.append(f"v {x + offset[0]!r} {y + offset[1]!r} {0.3 + offset[2]!r}")
                texture.append(f"vt {0.1 * i + panel!r} {0.1 * j!r}")
        for i in range(2):
            for j in range(2):
                a = count + 3 * i + j + 1
                lines += [f"f {a}/{a} {a + 3}/{a + 3} {a + 4}/{a + 4}", f"f {a}/{a} {a + 4}/{a + 4} {a + 1}/{a + 1}"]
        count += 9
    return "\n".join(texture + lines) + "\n"


def exported_scene(folder, offset=(0.0, 0.0, 0.0), **sections):
    """The panels, sewn, fall for four frames between a still ball and one that moves."""
    (folder / "panels.obj").write_text(panels_obj(offset))
    ball = {"mesh": "sphere", "radius": 0.05, "subdivisions": 0}
    x, y, z = offset
    return Scene(
        cloth={"mesh": "panels.obj", "rest": "vt", "weld": 1e-4, "name": "shirt"},
        body=[
            ball | {"name": "still", "position": [x, y, z - 1]},
            ball | {"name": "kick", "position": [x + 1, y, z], "motion": {"velocity": [0.0, 1.0, 0.5]}},
        ],
        **{
            "effects": {"inertia": {}, "membrane": {}, "gravity": {}},
            "solver": {"dt": 0.02, "threads": 1, "linear": "superlu"},
            "run": {"duration": 0.12, "frames_per_second": 25},
            **sections,
        },
        directory=folder,
    )


def exported_run(folder, **keywords):
    """The run of `exported_scene`."""
    return simulate(exported_scene(folder, **keywords), folder / "run")


def all_points(run, frame):
    """Vertices of cloth and bodies in a frame."""
    return np.concatenate([run.positions(frame), *(points for _, points, _ in run.bodies(frame))])


def glb_frames(path, times):
    """Points of each mesh of a glTF file at each time, by VTK's reader, which plays the animation; shared ones once."""
    from pyvista import MultiBlock, wrap
    from vtkmodules.vtkIOGeometry import vtkGLTFReader

    reader = vtkGLTFReader()
    reader.SetFileName(str(path))
    reader.ApplyDeformationsToGeometryOn()
    reader.UpdateInformation()
    for number in range(reader.GetNumberOfAnimations()):
        reader.EnableAnimation(number)
    reader.UpdateInformation()

    def leaves(block):
        parts = [block[i] for i in range(block.n_blocks)]
        return [leaf for part in parts for leaf in (leaves(part) if isinstance(part, MultiBlock) else [part])]

    frames = []
    for time in times:
        reader.UpdateTimeStep(float(time))
        frames.append([np.array(leaf.points, float) for leaf in leaves(wrap(reader.GetOutput()))])
    return frames
