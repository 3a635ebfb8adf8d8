"""Scalar bar and title of a picture."""

from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from clothsim.base.arrays import Floats
from clothsim.render.camera import Margins
from clothsim.render.colour_scale import Scale

_INK = (72, 74, 80)


def margins(size: tuple[int, int], with_bar: bool, title: str) -> Margins:
    """Margins that the legend takes from a picture of `size` (width, height) pixels."""
    em, (width, height) = _em(size), size
    return Margins(right=14 * em / width if with_bar else 0.08, top=max(0.08, 7 * em / height) if title else 0.08)


def add_legend(image: Floats, scale: Scale | None, title: str) -> np.ndarray:
    """`image (h, w, 3)`, sRGB in [0, 1], as uint8 with a title and, unless `scale` is None, its bar."""
    height, width = image.shape[:2]
    canvas = Image.fromarray(np.round(np.clip(image, 0, 1) * 255).astype(np.uint8))
    pen = ImageDraw.Draw(canvas)
    em = _em((width, height))
    if title:
        pen.text((1.6 * em, 1.3 * em), title, fill=_INK, font=ImageFont.load_default(1.25 * em), anchor="la")
    if scale is not None:
        _bar(canvas, scale, em)
    return np.asarray(canvas)


def label(pen: Any, corner: tuple[float, float], text: str, em: float) -> None:
    """Write a line of letters `em` pixels tall, its upper left corner there."""
    pen.text(corner, text, fill=_INK, font=ImageFont.load_default(em), anchor="la")


def _bar(canvas, scale: Scale, em: float) -> None:
    width, height = canvas.size
    tall, wide = round(0.42 * height), max(4, round(0.62 * em))
    left, top = round(width - 5.2 * em), round(0.5 * (height - 0.42 * height) + 0.5 * em)
    values = scale.high - (scale.high - scale.low) * (np.arange(tall) + 0.5) / tall
    column = np.round(scale.colours(values) * 255).astype(np.uint8)
    canvas.paste(Image.fromarray(np.ascontiguousarray(np.broadcast_to(column[:, None], (tall, wide, 3)))), (left, top))
    pen = ImageDraw.Draw(canvas)
    font = ImageFont.load_default(em)
    for value, text in scale.ticks:
        y = top + tall * (scale.high - value) / (scale.high - scale.low)
        pen.line((left + wide + 0.2 * em, y, left + wide + 0.5 * em, y), fill=_INK, width=max(1, round(em / 16)))
        pen.text((left + wide + 0.8 * em, y), text, fill=_INK, font=font, anchor="lm")
    for line, text in enumerate(reversed(scale.heading)):
        pen.text((left + 1.1 * em, top - (1.75 + 1.15 * line) * em), text, fill=_INK, font=font, anchor="ma")


def _em(size: tuple[int, int]) -> float:
    """The height of the letters in pixels."""
    return max(9.0, min(size) / 48)
