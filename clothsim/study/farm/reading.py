"""Files of a farm as they are read: ids, and hashes that hold; no link is followed."""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clothsim.base.errors import InputError
from clothsim.base.file_reading import read_arrays, read_regular_file

LETTERS = 16
REPAIR = "`clothsim farm repair DIR` takes it back into the plan, then `clothsim farm work DIR` makes it again."
"""What to do about a drape whose files are not what was published."""


CLOTH, SUMMARY, PARAMETERS, HASHES = "cloth.npy", "summary.json", "params.json", "sha256.json"
"""Files of a drape; the last one names the sha256 of each of the others."""
MESH_ARRAYS = ("start", "rest", "triangles", "material", "uv")
"""Arrays of a stored mesh; a body has the first and the third."""


def is_id(name: Any) -> bool:
    """True for LETTERS hexadecimal digits."""
    return isinstance(name, str) and re.fullmatch(f"[0-9a-f]{{{LETTERS}}}", name) is not None


def checked_id(name: Any, where: Path) -> str:
    """An id or a hash that a file names: whatever is joined to the folder of a farm goes through here.

    Raises
    ------
    InputError
        Where it is not LETTERS hexadecimal digits, such as a path that leads out of the farm.
    """
    if is_id(name):
        return str(name)
    raise InputError(
        f"{where} names {name!r}, which is not an id of a farm: an id is {LETTERS} hexadecimal digits.",
        "Take the file from where the farm was planned, or plan the recipe again in another folder.",
    )


def array_hash(*arrays: NDArray[Any]) -> str:
    """sha256 of types, shapes and bytes of arrays."""
    made = hashlib.sha256()
    for array in arrays:
        whole = np.ascontiguousarray(array)
        made.update(f"{whole.dtype.str}{whole.shape}".encode())
        made.update(whole.tobytes())
    return made.hexdigest()


def file_hash(content: bytes) -> str:
    """sha256 of the bytes of a file."""
    return hashlib.sha256(content).hexdigest()


def read_file(folder: Path, file: str) -> bytes:
    """The bytes of a file in a folder of a farm. InputError where there is none, or a link, which may lead anywhere."""
    path = folder / file
    if path.is_symlink() or folder.is_symlink():
        raise InputError(f"{path} is a link, which is not followed.", "Put the file itself there.")
    return read_regular_file(path)


def read_drape(farm: Path, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Summary and parameters of a published drape. InputError, with its id, where they are not what was published."""
    files = whole_files(farm, name, (SUMMARY, PARAMETERS))
    summary, parameters = (json.loads(content) for content in files.values())
    return summary, parameters


def whole_files(farm: Path, name: str, wanted: Sequence[str] = ()) -> dict[str, bytes]:
    """The files of a published drape, each with the hash that it was published with.

    wanted: the names of some, in their order; all without it. InputError, with the id, where one is missing or another.
    """
    folder = farm / "drapes" / checked_id(name, farm)
    try:
        hashes = json.loads(read_file(folder, HASHES))
        missing = {SUMMARY, PARAMETERS, *wanted}.difference(hashes)
        names = () if missing else tuple(wanted or hashes)
        for file in names:  # such as a path that leads out of the folder
            if file not in (CLOTH, SUMMARY, PARAMETERS):
                raise InputError(f"{HASHES} names {file!r}, which is not a file of a drape.", REPAIR)
        files = {file: read_file(folder, file) for file in names}
    except (InputError, ValueError, TypeError, RecursionError) as error:
        what = error.sentence if isinstance(error, InputError) else f"{HASHES} is not what was published."
        raise InputError(f"Drape {name} is torn: {what}", REPAIR) from error
    bad = [*missing, *(file for file, content in files.items() if file_hash(content) != hashes[file])]
    if bad:
        raise InputError(f"Drape {name} is torn: {bad[0]} is not what was published.", REPAIR)
    return files


def positions_of(farm: Path, name: str) -> NDArray[np.float32]:
    """The vertices of a published drape: (n, 3), or (frames, n, 3) [m]. InputError where they are not whole."""
    content = whole_files(farm, name, (CLOTH,))[CLOTH]
    return np.asarray(np.load(BytesIO(content), allow_pickle=False))


def mesh_file(farm: Path, digest: Any) -> Path:
    """The file of a stored mesh. InputError where a summary names what is not a hash."""
    return farm / "meshes" / f"{checked_id(digest, farm / 'drapes')}.npz"


def read_stored_mesh(farm: Path, digest: Any) -> dict[str, NDArray[Any]]:
    """The arrays of a stored mesh. InputError where they do not have the hash that is its name."""
    file = mesh_file(farm, digest)
    try:
        arrays = read_arrays(file, list(MESH_ARRAYS))
        whole = not file.is_symlink() and mesh_hash(arrays) == digest
    except InputError:
        whole = False
    if not whole:
        raise InputError(f"Mesh {digest} is torn: {file} is not what was stored.", REPAIR)
    return arrays


def mesh_hash(arrays: Mapping[str, NDArray[Any]]) -> str:
    """The hash under which arrays are stored."""
    return array_hash(*(arrays[name] for name in sorted(arrays)))[:LETTERS]
