"""Scalar bar and title of a picture."""

from typing import Any

import numpy as np

from clothsim.arrays import Floats
from clothsim.render.camera import Margins
from clothsim.render.colormap import stretch_colours, ticks

_INK = (72, 74, 80)


def margins(size: tuple[int, int], with_bar: bool, title: str) -> Margins:
    """Margins that the legend takes from a picture of `size` (width, height) pixels."""
    em, (width, height) = _em(size), size
    return Margins(right=14 * em / width if with_bar else 0.08, top=max(0.08, 7 * em / height) if title else 0.08)


def add_legend(image: Floats, half_range: float, title: str) -> np.ndarray:
    """`image (h, w, 3)`, sRGB in [0, 1], as uint8 with a title and a bar of the stretch, none if half_range is 0."""
    from PIL import Image, ImageDraw

    height, width = image.shape[:2]
    canvas = Image.fromarray(np.round(np.clip(image, 0, 1) * 255).astype(np.uint8))
    pen = ImageDraw.Draw(canvas)
    em = _em((width, height))
    if title:
        pen.text((1.6 * em, 1.3 * em), title, fill=_INK, font=_font(1.25 * em), anchor="la")
    if half_range > 0:
        _bar(canvas, half_range, em)
    return np.asarray(canvas)


def label(pen: Any, corner: tuple[float, float], text: str, em: float) -> None:
    """Write a line of letters `em` pixels tall, its upper left corner there."""
    pen.text(corner, text, fill=_INK, font=_font(em), anchor="la")


def _bar(canvas, half_range: float, em: float) -> None:
    from PIL import Image, ImageDraw

    width, height = canvas.size
    tall, wide = round(0.42 * height), max(4, round(0.62 * em))
    left, top = round(width - 5.2 * em), round(0.5 * (height - 0.42 * height) + 0.5 * em)
    logs = half_range * (1 - 2 * (np.arange(tall) + 0.5) / tall)
    column = np.round(stretch_colours(logs, half_range) * 255).astype(np.uint8)
    canvas.paste(Image.fromarray(np.ascontiguousarray(np.broadcast_to(column[:, None], (tall, wide, 3)))), (left, top))
    pen = ImageDraw.Draw(canvas)
    font = _font(em)
    for stretch in ticks(half_range):
        y = top + tall * 0.5 * (1 - np.log(stretch) / half_range)
        pen.line((left + wide + 0.2 * em, y, left + wide + 0.5 * em, y), fill=_INK, width=max(1, round(em / 16)))
        pen.text((left + wide + 0.8 * em, y), f"{stretch:g}", fill=_INK, font=font, anchor="lm")
    pen.text((left + 1.1 * em, top - 2.5 * em), "principal", fill=_INK, font=font, anchor="ma")
    pen.text((left + 1.1 * em, top - 1.35 * em), "stretch", fill=_INK, font=font, anchor="ma")


def _em(size: tuple[int, int]) -> float:
    """The height of the letters in pixels."""
    return max(9.0, min(size) / 48)


def _font(pixels: float):
    from PIL import ImageFont

    return ImageFont.load_default(pixels)
