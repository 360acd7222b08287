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

WIDTH = 480  # of pictures on the page, about, if they have fewer pixels
# Of maps: black, violet, orange, pale yellow, in sRGB.
RAMP = np.array([(0, 0, 4), (87, 16, 110), (188, 55, 84), (249, 142, 9), (252, 255, 164)])


@dataclass
class Entry:
    """One comparison under its name, and the commands that repeat and accept it."""

    name: str
    comparison: Comparison
    commands: Mapping[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass
class Failure:
    """A check that came to no comparison: why, what to do, and what pictures there are."""

    name: str
    problem: str
    commands: Mapping[str, str] = field(default_factory=dict)
    pictures: Mapping[str, Image] = field(default_factory=dict)


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
    size = _size(a)
    maps = "".join(
        f'<figure><img src="{source}" alt="{html.escape(name)}" {size}>'
        f"<figcaption>{html.escape(name)}</figcaption></figure>"
        for name, source in _maps(result).items()
    )
    shown = f", shown at {exposure:.3g} times their brightness" if exposure != 1 else ""
    return f"""<section class="{"different" if result.different else "same"}">
<h2>{html.escape(entry.name)} <small>{verdict}</small></h2>
<ul>{lines}</ul>
<div class="pictures">
<figure>
<div class="slider" {size}>
<img src="{shown_as[0]}" alt="reference">
<img class="over" src="{shown_as[1]}" alt="picture">
<span class="line"></span>
<input type="range" min="0" max="100" step="any" value="50"
 aria-label="from reference to picture">
</div>
<figcaption><span>picture</span><span>drag the line{shown}</span><span>reference</span></figcaption>
</figure>
{maps}
</div>
<dl>{_commands(entry.commands)}</dl>
{_tables(result)}
</section>"""


def failure_section(failure: Failure) -> str:
    """Of a check without a comparison."""
    pictures = "".join(
        f'<figure><img src="{_png(views.encode(x["color"] * _exposure(x), x.color_space))}" '
        f'alt="{html.escape(what)}" {_size(x)}>'
        f"<figcaption>{html.escape(what)}, {x.width}x{x.height}</figcaption></figure>"
        for what, x in failure.pictures.items()
    )
    return f"""<section class="different">
<h2>{html.escape(failure.name)} <small>not compared</small></h2>
<ul><li>{html.escape(failure.problem)}</li></ul>
<div class="pictures">{pictures}</div>
<dl>{_commands(failure.commands)}</dl>
</section>"""


def _commands(commands: Mapping[str, str]) -> str:
    return "".join(
        f"<dt>{html.escape(what)}</dt><dd><code>{html.escape(command)}</code></dd>"
        for what, command in commands.items()
    )


def _size(picture: Image) -> str:
    width = _zoom(picture.width) * picture.width
    return f'style="width:{width}px;aspect-ratio:{picture.width}/{picture.height}"'


def _zoom(width: int) -> int:
    """Of small pictures, so that their pixels are seen."""
    return max(WIDTH // width, 1)


def _exposure(picture: Image) -> float:
    """A power of two that brings very dark and very bright pictures into view; mostly 1."""
    mean = float(np.nan_to_num(picture["color"], posinf=0, neginf=0).mean())
    if not mean > 0 or 0.02 < mean < 2:
        return 1.0
    return float(2.0 ** np.round(np.log2(0.2 / mean)))


def _maps(result: Comparison) -> dict[str, str]:
    a, b = (
        np.nan_to_num(x["color"], posinf=0, neginf=0) for x in (result.reference, result.picture)
    )
    change = (b - a).mean(axis=-1)
    scale = float(np.quantile(np.abs(a), 0.9)) or float(np.abs(change).max()) or 1.0
    red_blue = np.clip(0.5 + np.stack([change, 0 * change, -change], axis=-1) / scale, 0, 1)
    maps = {
        "difference: orange where brighter, blue where darker": _png(
            (255 * red_blue).astype(np.uint8)
        )
    }
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
    x = np.clip(np.nan_to_num(values), 0, 1) * (len(RAMP) - 1)
    channels = [np.interp(x, range(len(RAMP)), RAMP[:, c]) for c in range(3)]
    return _png(np.stack(channels, axis=-1).astype(np.uint8))


def _png(pixels: npt.NDArray[np.uint8]) -> str:
    """(height, width, 3) as a data URL."""
    return "data:image/png;base64," + base64.b64encode(png_of(pixels)).decode()


STYLE = """
:root { color-scheme: light dark; --faint: light-dark(#666, #aaa); }
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 1100px; padding: 0 1em;
  color: light-dark(#222, #ddd); background: light-dark(#fff, #1c1c1c); }
h1 { font-size: 1.4em; }
h2 { font-size: 1.2em; overflow-wrap: anywhere; }
h2 small { font-weight: 600; font-size: .75em; color: #fff; background: #287a4b; padding: 2px 8px;
  border-radius: 9px; margin-left: .4em; }
.different h2 small { background: #c0362c; }
section { border-top: 1px solid light-dark(#ddd, #444); margin: 2em 0; padding-top: .5em; }
ul { padding-left: 1.2em; }
.pictures { display: flex; flex-wrap: wrap; gap: 18px; }
figure { margin: 0; max-width: 100%; }
figure > img, .slider { display: block; max-width: 100%; image-rendering: pixelated; }
figcaption { color: var(--faint); font-size: 13px; display: flex; justify-content: space-between; }
.slider { position: relative; overflow: hidden; --at: 50%; }
.slider img { position: absolute; inset: 0; width: 100%; height: 100%;
  image-rendering: pixelated; }
.slider .over { clip-path: inset(0 calc(100% - var(--at)) 0 0); }
.slider .line { position: absolute; inset: 0 auto 0 var(--at); width: 2px; margin-left: -1px;
  background: #fff; box-shadow: 0 0 3px #000; }
.slider input { position: absolute; inset: 0; width: 100%; height: 100%; margin: 0; opacity: 0;
  cursor: ew-resize; }
.slider:focus-within { outline: 2px solid #48f; outline-offset: 2px; }
table { border-collapse: collapse; margin: .5em 0; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; }
th, td { padding: 1px 1.2em 1px 0; vertical-align: top; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: auto 1fr; gap: 4px 1.2em; margin: 1em 0; }
dt { font-weight: 600; }
dd { margin: 0; }
code { background: light-dark(#f2f2f2, #333); padding: 2px 5px; user-select: all; }
"""

SCRIPT = """
for (const range of document.querySelectorAll("input[type=range]")) {
  const show = () => range.parentElement.style.setProperty("--at", range.value + "%");
  range.addEventListener("input", show);
  show(); // what a browser kept from before
}
"""
