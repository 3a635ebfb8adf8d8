"""Scalar bar of a page: a horizontal bar of colours with its ticks, as HTML."""

from html import escape

import numpy as np

from clothsim.render import Scale

STOPS = 17
"""Colours of the bar, equally spaced."""


def legend_html(scale: Scale | None) -> str:
    """Bar of a scale with its heading and ticks; empty where the cloth is plain."""
    if scale is None:
        return ""
    painted = scale.colours(np.linspace(scale.low, scale.high, STOPS))
    stops = ", ".join("#" + "".join(f"{round(255 * channel):02x}" for channel in colour) for colour in painted)
    ticks = "".join(
        f'<span style="position:absolute; left:{share:.1f}%; transform:translateX(-{share:.1f}%)">{escape(text)}</span>'
        for share, text in ((100 * (value - scale.low) / (scale.high - scale.low), text) for value, text in scale.ticks)
    )
    return (
        f'<div style="padding:0 1em 0.4em; font-size:0.8em">{escape(" ".join(scale.heading))}'
        f'<div style="height:0.8em; background:linear-gradient(to right, {stops})"></div>'
        f'<div style="position:relative; height:1.2em">{ticks}</div></div>'
    )
