"""Losses by name, and those of files: a drape to come to, or points measured on one."""

from pathlib import Path

import numpy as np

from clothsim.base.errors import InputError
from clothsim.files.meshes.mesh_file import read_mesh
from clothsim.gradients.losses import Distance, Girth, Height, Loss, Scan, Silhouette, hem_loss
from clothsim.gradients.scan import POINTS, read_cloud
from clothsim.mesh.world import World
from clothsim.run.results import open_run


def named_loss(name: str, world: World, value: float | Path | None = None, scale: float = 1.0) -> Loss:
    """Return the loss with a given name.

    Parameters
    ----------
    name : {"height", "hem", "silhouette", "girth", "target"}
        Mean height of the cloth, or of the side of its border that hangs lowest; area of its shadow on the ground;
        length of its cut with a level plane; squared distance to a drape.
    world : World
        Of the scene.
    value : float or Path, optional
        Height of the girth [m]; file of the target, as of `target_loss`.
    scale : float
        Metres per unit of that file.

    Raises
    ------
    InputError
        For another name, and a target that cannot be read.
    """
    if name == "target" and isinstance(value, Path):
        return target_loss(value, world, scale)
    if name not in ("height", "hem", "silhouette", "girth", "target"):
        raise InputError(f"There is no loss {name!r}.", "There are height, hem, silhouette, girth and target.")
    if name == "girth" and isinstance(value, int | float):
        return Girth(value)
    if name == "hem":
        return hem_loss(world)
    return Height() if name == "height" else Silhouette()


def target_loss(path: Path, world: World, scale: float = 1.0) -> Loss:
    """Return the loss of a target.

    Parameters
    ----------
    path : Path
        A mesh file, an .xyz file of points, or the directory of a run, whose last frame is the target.
    world : World
        Of the scene that is compared with it.
    scale : float
        Metres per unit of the file.

    Returns
    -------
    Loss
        `Distance` where the target has the triangles of the cloths in their order, `Scan` of its vertices else.

    Raises
    ------
    InputError
        For a target that cannot be read.
    """
    n = world.n_cloth
    if path.is_dir():
        frame = open_run(path)[-1]
        names = [cloth.name for cloth in world.cloths]
        if any(len(frame.positions.get(c.name, ())) != len(c.rest_positions) for c in world.cloths):
            raise InputError(f"The run in {path} has other cloths than {', '.join(names)}.", "Give a run of the scene.")
        return Distance(np.concatenate([frame.positions[name] for name in names]).astype(np.float64))
    if path.suffix.lower() == POINTS:
        points, normals = read_cloud(path, scale)
        return Scan(points, normals=normals)
    mesh = read_mesh(path, scale=scale)
    same = len(mesh.positions) == n and np.array_equal(mesh.triangles, world.triangles)
    return Distance(mesh.positions) if same else Scan(mesh.positions)
