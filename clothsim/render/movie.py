"""MP4, WebP or GIF of a run, with one camera and one colour range."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from clothsim.base.arrays import as_positive
from clothsim.base.errors import InputError, MissingPackageError
from clothsim.base.file_writing import replacing
from clothsim.base.record import GIF_NAME, MOVIE_NAME
from clothsim.render.colour_scale import Quantity
from clothsim.render.picture import PictureSetup, picture_setup, pixel_counts, rendered
from clothsim.render.surface_look import Surface

MOVIE_ENDINGS = (".mp4", ".webp", ".gif")


def movie(
    path: str | Path,
    frames: Iterable[Sequence[Surface]],
    *,
    frames_per_second: float = 24.0,
    size: tuple[int, int] = (960, 720),
    colour: str | Quantity = "auto",
    up: ArrayLike | str = "z",
    view: ArrayLike | str = "auto",
    title: str = "",
    renderer: str = "auto",
    samples: int = 2,
    smooth: bool = True,
    style: str = "fields",
    limits: tuple[float, float] | None = None,
    follow: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> str:
    """Write a movie of frames.

    Parameters
    ----------
    path : str or Path
        A file that ends in .mp4, .webp or .gif. A .gif shows at most 50 frames a second, in steps of 10 ms, and 128
        colours; a .webp shows all of them.
    frames : iterable of sequences of Surface
        The surfaces of each frame.
    frames_per_second : float
        Rate [1/s].
    size, colour, up, view, title, renderer, smooth, style, limits
        As of `picture.draw`.
    follow : bool
        True: the camera moves with the centre of the cloths.
    samples : int
        Samples of a pixel in each direction; 1 is faster and rougher.
    progress : callable
        Called with the frames drawn and all frames after each of them.

    Returns
    -------
    str
        One line that names the renderer.

    Raises
    ------
    InputError
        For another suffix or a bad argument.
    MissingPackageError
        For an .mp4 without the extra `movies`.
    """
    target = Path(path)
    if target.suffix.lower() not in MOVIE_ENDINGS:
        raise InputError(f"A movie ends in {', '.join(MOVIE_ENDINGS)}, not {target.name!r}.")
    if target.suffix.lower() == ".mp4" and not has_ffmpeg():
        raise MissingPackageError(
            f"{target.name} needs ffmpeg, which is not installed.",
            "Run: pip install 'clothsim[movies]', or end the name in .webp.",
        )
    rate = as_positive("frames_per_second", frames_per_second)
    all_frames = frames if isinstance(frames, Sequence) else list(frames)
    width, height = pixel_counts(size)
    even = (width // 2 * 2, height // 2 * 2)  # H.264 halves the colour's resolution
    given = {"size": even, "colour": colour, "up": up, "view": view, "title": title, "renderer": renderer}
    look = {"samples": samples, "smooth": smooth, "style": style, "limits": limits, "follow": follow}
    setup = picture_setup(all_frames, **look, **given)  # type: ignore[arg-type]
    pictures = _pictures(setup, all_frames, progress)
    with replacing(target) as beside:
        beside.touch()  # what cannot be written is named before it is drawn
        if target.suffix.lower() == ".mp4":
            as_mp4 = ["-f", "mp4"]  # whatever the name ends in
            writer = _ffmpeg().write_frames(
                str(beside), even, fps=rate, quality=8, macro_block_size=2, output_params=as_mp4
            )
            writer.send(None)
            try:
                for picture in pictures:
                    writer.send(np.ascontiguousarray(picture))
            finally:
                writer.close()
        elif target.suffix.lower() == ".webp":
            _write_images(beside, map(Image.fromarray, pictures), "WEBP", 1000 / rate, quality=80, method=4)
        else:
            few = (Image.fromarray(each).quantize(128, dither=Image.Dither.NONE) for each in pictures)
            _write_images(beside, few, "GIF", max(20, 10 * round(100 / rate)), optimize=False)
    return setup.note


def _pictures(
    setup: PictureSetup, frames: Sequence[Sequence[Surface]], progress: Callable[[int, int], None]
) -> Iterator[np.ndarray]:
    for number, surfaces in enumerate(frames):
        yield rendered(setup, surfaces)
        progress(number + 1, len(frames))


def movie_file(directory: Path) -> tuple[Path, str]:
    """The movie of a directory, and a sentence where it is a .gif because ffmpeg is missing."""
    if has_ffmpeg():
        return directory / MOVIE_NAME, ""
    missing = f"{GIF_NAME}, not {MOVIE_NAME}: ffmpeg is missing. Run: pip install 'clothsim[movies]'"
    return directory / GIF_NAME, missing


def has_ffmpeg() -> bool:
    """True where imageio-ffmpeg is installed and brings, or finds, the program."""
    return _ffmpeg() is not None


def _ffmpeg() -> Any:
    """The module imageio_ffmpeg, None where it or its program is not there."""
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        return None
    return imageio_ffmpeg


def _write_images(target: Path, frames: Iterable[Image.Image], kind: str, milliseconds: float, **options: Any) -> None:
    """Write frames that are shown for so long each, again and again."""
    first, *others = frames
    shown = {"save_all": True, "append_images": others, "duration": round(milliseconds), "loop": 0}
    first.save(target, format=kind, **shown, **options)
