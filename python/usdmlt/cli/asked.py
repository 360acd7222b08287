"""What a command line asks to render: its flags, or a picture that is made again and its flags."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from usdmlt import layers
from usdmlt._version import __version__
from usdmlt.cli.reading import load_options
from usdmlt.errors import UsageError
from usdmlt.settings import Settings, merged

logger = logging.getLogger("usdmlt")


@dataclass(frozen=True)
class Asked:
    """What the flags ask for: the stage, the options of reading, and those of rendering.

    ``until``: the number of work units where a picture is made again, else None.
    """

    stage: str
    options: dict[str, Any]
    settings: dict[str, Any]
    until: int | None = None


def read_asked(arguments: argparse.Namespace) -> Asked:
    """The flags, over what a picture says that is made again; checked."""
    given = given_settings(arguments)
    primvars = Settings(**given).primvars
    options = load_options(arguments) | {"strict": arguments.strict, "primvars": primvars}
    if arguments.made is None:
        if arguments.stage is None:
            raise UsageError("name the STAGE to render, or a picture --from which to make it again")
        return Asked(arguments.stage, options, given)
    from usdmlt.making import read_making
    from usdmlt.options import LoadOptions

    making = read_making(arguments.made)
    if making.version != __version__:
        logger.warning(
            "%s was made by usdmlt %s, and this is %s: the bits may differ",
            arguments.made,
            making.version,
            __version__,
        )
    if arguments.output is None:
        again = Path(arguments.made)
        again = again.with_name(f"{again.stem}_again{again.suffix}")
        arguments.stage, arguments.output = None, arguments.stage or str(again)
    default = LoadOptions()
    changed = {name: v for name, v in options.items() if v != getattr(default, name)}
    kept = making.options
    if "width" in changed and "height" not in changed:
        kept = {name: v for name, v in kept.items() if name != "height"}
    settings = asdict(merged(making.settings, given))
    until: int | None = making.units
    if changed or given.keys() - {"threads"}:
        # Units are of another picture now; of one that was stopped, as much for each pixel.
        until = None
        if not {"samples", "mutations", "time", "target_error"} & given.keys():
            budget = "samples" if settings["mutations"] is None else "mutations"
            settings[budget] = min(settings[budget], max(round(making.samples_per_pixel), 1))
    return Asked(arguments.stage or making.stage, kept | changed, settings, until)


def given_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """The settings that flags were given for."""
    names = ("integrator", "samples", "mutations", "time", "depth", "seed", "threads", "filter")
    values = {
        name: getattr(arguments, name) for name in (*names, "direct", "selective", "two_stage")
    }
    values["target_error"] = arguments.error
    if arguments.aov is not None:
        values["aovs"] = [name for flag in arguments.aov for name in layers.split(flag)]
    values["mutation_weights"] = parse_weights(arguments.mutation_weights)
    return {name: value for name, value in values.items() if value is not None}


def parse_weights(flags: Sequence[str] | None) -> dict[str, float] | None:
    """`lens=0.4,bidirectional=0.6`, of one flag or several; None where there is none."""
    if flags is None:
        return None
    weights: dict[str, float] = {}
    for item in ",".join(flags).split(","):
        name, _, weight = (part.strip() for part in item.partition("="))
        if name in weights:
            raise UsageError(f"--mutation-weights has two weights for {name}")
        try:
            weights[name] = float(weight)
        except ValueError:
            raise UsageError(f"--mutation-weights: {item!r} is not NAME=WEIGHT") from None
    return weights
