"""MP4 or GIF of a run, with one camera and one colour range."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from clothsim.arrays import as_positive
from clothsim.errors import InputError, MissingPackageError
from clothsim.render.colour_scale import Quantity
from clothsim.render.picture import Shot, expose, pixel_counts, take_aim
from clothsim.render.surface_look import Surface


def movie(
    path: str | Path,
    frames: Iterable[Sequence[Surface]],
    *,
    frames_per_second: float = 24.0,
    size: tuple[int, int] = (960, 720),
    colour: str | Quantity = "stretch",
    up: ArrayLike | str = "z",
    view: ArrayLike | str = "auto",
    title: str = "",
    renderer: str = "auto",
    samples: int = 2,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> str:
    """Write the frames to `path`, as .mp4 or .gif by its suffix; returns one line that names the renderer.

    An .mp4 needs the extra `movies`: MissingPackageError without it. A .gif needs no more than Pillow; it shows at most
    50 frames a second in steps of 10 ms. progress(done, total) is called after each frame; other arguments as in
    `picture.draw`. samples: per pixel and direction, 1 is faster and rougher.
    """
    target = Path(path)
    if target.suffix.lower() not in (".mp4", ".gif"):
        raise InputError(f"A movie ends in .mp4 or .gif, not {target.name!r}.")
    if target.suffix.lower() == ".mp4" and not has_ffmpeg():
        raise MissingPackageError(
            f"{target.name} needs ffmpeg, which is not installed.",
            "Run: pip install 'clothsim[movies]', or end the name in .gif.",
        )
    rate = as_positive("frames_per_second", frames_per_second)
    all_frames = frames if isinstance(frames, Sequence) else list(frames)
    width, height = pixel_counts(size)
    even = (width // 2 * 2, height // 2 * 2)  # H.264 halves the colour's resolution
    shot = take_aim(
        all_frames, size=even, colour=colour, up=up, view=view, title=title, renderer=renderer, samples=samples
    )
    pictures = _pictures(shot, all_frames, progress)
    if target.suffix.lower() == ".mp4":
        _write_mp4(target, pictures, rate, even)
    else:
        _write_gif(target, pictures, rate)
    return shot.note


def _pictures(
    shot: Shot, frames: Sequence[Sequence[Surface]], progress: Callable[[int, int], None]
) -> Iterator[np.ndarray]:
    for number, surfaces in enumerate(frames):
        yield expose(shot, surfaces)
        progress(number + 1, len(frames))


def has_ffmpeg() -> bool:
    """True where imageio-ffmpeg is installed and brings, or finds, the program."""
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return False
    return True


def _write_mp4(target: Path, pictures: Iterator[np.ndarray], rate: float, size: tuple[int, int]) -> None:
    import imageio_ffmpeg

    writer = imageio_ffmpeg.write_frames(str(target), size, fps=rate, quality=8, macro_block_size=2)
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()


def _write_gif(target: Path, pictures: Iterator[np.ndarray], rate: float) -> None:
    from PIL import Image

    frames = [Image.fromarray(picture).quantize(128, dither=Image.Dither.NONE) for picture in pictures]
    milliseconds = max(20, round(100 / rate) * 10)
    frames[0].save(
        target, format="GIF", save_all=True, append_images=frames[1:], duration=milliseconds, loop=0, optimize=False
    )
