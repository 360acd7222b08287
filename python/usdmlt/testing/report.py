"""A page of HTML that shows comparisons: one file, which needs no network."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from usdmlt import views
from usdmlt.image import Image
from usdmlt.image_files import png_of
from usdmlt.testing import metrics
from usdmlt.testing.comparison import Comparison, detectable

# Of maps: black, violet, orange, pale yellow, in sRGB.
RAMP = np.array([(0, 0, 4), (87, 16, 110), (188, 55, 84), (249, 142, 9), (252, 255, 164)])


@dataclass
class Entry:
    """One comparison under its name, and the commands that repeat and accept it."""

    name: str
    comparison: Comparison
    commands: Mapping[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def page(sections: Iterable[str], title: str = "usdmlt: compared pictures") -> str:
    """The whole file."""
    body = "\n".join(sections) or "<p>No pictures were compared.</p>"
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    )
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width">
<title>{html.escape(title)}</title>
<style>{STYLE}</style>
</head>
<body>
<h1>{html.escape(title)}</h1>
{body}
<script>{SCRIPT}</script>
</body>
</html>
"""


def section(entry: Entry) -> str:
    """Of one comparison: pictures with a slider, maps, numbers and commands."""
    result = entry.comparison
    a, b = result.reference, result.picture
    exposure = _exposure(a)
    shown_as = [_png(views.encode(x["color"] * exposure, x.color_space)) for x in (a, b)]
    verdict = "different" if result.different else "the same"
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in [*result.lines(), *entry.notes])
    commands = "".join(
        f"<dt>{html.escape(what)}</dt><dd><code>{html.escape(command)}</code></dd>"
        for what, command in entry.commands.items()
    )
    maps = "".join(
        f'<figure><img src="{source}" alt="{html.escape(name)}" width="{a.width}" '
        f'height="{a.height}"><figcaption>{html.escape(name)}</figcaption></figure>'
        for name, source in _maps(result).items()
    )
    shown = f", shown at {exposure:.3g} times their brightness" if exposure != 1 else ""
    return f"""<section class="{"different" if result.different else "same"}">
<h2>{html.escape(entry.name)} <small>{verdict}</small></h2>
<ul>{lines}</ul>
<figure>
<div class="slider" style="width:{a.width}px;height:{a.height}px">
<img src="{shown_as[0]}" alt="reference" width="{a.width}" height="{a.height}">
<img class="over" src="{shown_as[1]}" alt="picture" width="{a.width}" height="{a.height}">
</div>
<input type="range" min="0" max="100" value="50" aria-label="from reference to picture"
 style="width:{a.width}px">
<figcaption>left of the line the picture, right of it the reference{shown}</figcaption>
</figure>
<div class="maps">{maps}</div>
{_tables(result)}
<dl>{commands}</dl>
</section>"""


def _exposure(picture: Image) -> float:
    """A power of two that brings very dark and very bright pictures into view; mostly 1."""
    mean = float(np.nan_to_num(picture["color"]).mean())
    if not mean > 0 or 0.02 < mean < 2:
        return 1.0
    return float(2.0 ** np.round(np.log2(0.2 / mean)))


def _maps(result: Comparison) -> dict[str, str]:
    a, b = (np.nan_to_num(x["color"]) for x in (result.reference, result.picture))
    change = (b - a).mean(axis=-1)
    scale = float(np.quantile(np.abs(a), 0.9)) or float(np.abs(change).max()) or 1.0
    red_blue = np.clip(0.5 + np.stack([change, 0 * change, -change], axis=-1) / scale, 0, 1)
    maps = {"difference: red brighter, blue darker": _png((255 * red_blue).astype(np.uint8))}
    if result.outcome is not None:
        significance = result.outcome.map
        size = -(-a.shape[0] // significance.shape[0])
        full = significance.repeat(size, axis=0).repeat(size, axis=1)[: a.shape[0], : a.shape[1]]
        most = 2 * -np.log10(result.outcome.significance)
        maps[f"significance: bright from p = {result.outcome.significance:g}"] = _ramp(full / most)
    flip = metrics.flip_map(b, a, result.reference.color_space)
    if flip is not None:
        maps["FLIP, 0 to 1"] = _ramp(flip)
    else:
        maps["SMAPE, 0 to 1"] = _ramp(metrics.smape_map(b, a))
    return maps


def _tables(result: Comparison) -> str:
    rows: dict[str, str] = {"decided by": result.method}
    if result.outcome is not None:
        rows["p"] = f"{result.outcome.p:.3g}"
        rows["false alarms"] = f"{result.outcome.significance:g}"
        rows["detectable"] = detectable(result.outcome)
    keys = sorted(result.reference.metadata.keys() | result.picture.metadata.keys())
    values = "".join(
        f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
        for name, value in rows.items()
    )
    settings = "".join(
        f"<tr><th>{html.escape(key)}</th>"
        + "".join(
            f"<td>{html.escape(str(x.metadata.get(key, '')))}</td>"
            for x in (result.reference, result.picture)
        )
        + "</tr>"
        for key in keys
        if not isinstance(result.reference.metadata.get(key), (np.ndarray, tuple))
        and not key.startswith("worldTo")
    )
    return (
        f"<table>{values}</table><details><summary>how they were made</summary><table>"
        f"<tr><th></th><th>reference</th><th>picture</th></tr>{settings}</table></details>"
    )


def _ramp(values: npt.NDArray[np.floating]) -> str:
    """Values from 0 to 1 as colours."""
    x = np.clip(values, 0, 1) * (len(RAMP) - 1)
    channels = [np.interp(x, range(len(RAMP)), RAMP[:, c]) for c in range(3)]
    return _png(np.stack(channels, axis=-1).astype(np.uint8))


def _png(pixels: npt.NDArray[np.uint8]) -> str:
    """(height, width, 3) as a data URL."""
    return "data:image/png;base64," + base64.b64encode(png_of(pixels)).decode()


STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em; max-width: 80em; color: #222; }
section { border-left: 5px solid #2a7; padding: 0 1.2em 1em; margin: 2em 0; }
section.different { border-color: #c33; }
h2 small { font-weight: normal; color: #777; }
figure { display: inline-block; margin: 0 1em 1em 0; }
figcaption { color: #666; font-size: 13px; }
.slider { position: relative; overflow: hidden; }
.slider img { position: absolute; inset: 0; image-rendering: pixelated; }
.slider .over { clip-path: inset(0 50% 0 0); }
.maps img { image-rendering: pixelated; }
input[type=range] { display: block; margin: 4px 0; }
table { border-collapse: collapse; margin: .5em 0; }
th { text-align: left; font-weight: 600; }
th, td { padding: 1px 1.2em 1px 0; vertical-align: top; }
code { background: #f2f2f2; padding: 2px 5px; }
"""

SCRIPT = """
for (const range of document.querySelectorAll("input[type=range]")) {
  const over = range.parentElement.querySelector(".over");
  range.addEventListener("input", () => {
    over.style.clipPath = `inset(0 ${100 - range.value}% 0 0)`;
  });
}
"""
