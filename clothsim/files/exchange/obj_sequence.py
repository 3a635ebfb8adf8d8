"""Wavefront OBJ, a file a frame: positions to the last bit, texture, normals; an object a surface, a group a panel."""

from pathlib import Path

from clothsim.base.file_writing import write_atomically
from clothsim.files.exchange.animation import Animation, Part, PartFrame, different, flat_texture, group_runs, one_word


def files(animation: Animation, target: Path) -> list[Path]:
    """A file for each frame: target_0000.obj, target_0001.obj, ...; of one frame the target itself."""
    if animation.alone:
        return [target]
    count = len(animation.times)
    digits = max(4, len(str(count - 1)))
    return [target.with_name(f"{target.stem}_{k:0{digits}d}{target.suffix}") for k in range(count)]


def write(animation: Animation, target: Path) -> None:
    """Write the files."""
    for k, path in enumerate(files(animation, target)):
        write_atomically(path, frame_text(animation, k).encode())


def frame_text(animation: Animation, frame: int) -> str:
    """The text of a frame, with unit and axis in a comment."""
    lines = [f"# clothsim, {animation.times[frame]:.9g} s, 1 unit = {animation.unit:.9g} m, {animation.up} up"]
    counts = [0, 0]
    if any(len(part.texture) for part in animation.parts):
        lines.append("vt 0.0 0.0")  # of the parts without texture: some readers drop all where some corners have none
        counts[1] = 1
    names = different([part.name for part in animation.parts], one_word)
    for name, part, shape in zip(names, animation.parts, animation.at(frame), strict=True):
        lines += _part_lines(name, part, shape, counts)
    return "\n".join(lines) + "\n"


def _part_lines(name: str, part: Part, shape: PartFrame, counts: list[int]) -> list[str]:
    """The lines of a surface; counts: vertices and texture coordinates before it, which grow."""
    lines = [f"o {name}"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in shape.points.tolist()]
    lines += [f"vn {x:.7g} {y:.7g} {z:.7g}" for x, y, z in shape.normals.tolist()]
    vertex = (part.triangles + counts[0] + 1).tolist()
    if len(part.texture):
        rows, corners = flat_texture(part)
        lines += [f"vt {u!r} {v!r}" for u, v in rows.tolist()]
        both = zip(vertex, (corners + counts[1] + 1).tolist(), strict=True)
        faces = [" ".join(f"{i}/{t}/{i}" for i, t in zip(a, b, strict=True)) for a, b in both]
        counts[1] += len(rows)
    else:
        none = "1" if counts[1] else ""
        faces = [" ".join(f"{i}/{none}/{i}" for i in a) for a in vertex]
    for names, first, stop in group_runs(part):
        lines.append(f"g {' '.join(map(one_word, names)) if names else name}")
        lines += [f"f {face}" for face in faces[first:stop]]
    counts[0] += len(shape.points)
    return lines


def still_mesh(part: Part, shape: PartFrame) -> bytes:
    """An OBJ of one surface."""
    return ("\n".join(_part_lines(one_word(part.name), part, shape, [0, 0])) + "\n").encode()
