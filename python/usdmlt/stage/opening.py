"""Opening a stage, and choosing the time that is rendered."""

from __future__ import annotations

import logging
import math
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from usdmlt.errors import Error, Report, UsageError

log = logging.getLogger("usdmlt")

EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")


def open_stage(
    stage: Usd.Stage | str | os.PathLike[str],
    mask: Iterable[str] | None = None,
    session_layer: str | os.PathLike[str] | None = None,
) -> Usd.Stage:
    """The stage to read: the given one, or a file opened with all its payloads.

    ``mask``: prim paths; only they, their ancestors and descendants are there. ``session_layer``: a
    layer file whose opinions are strongest. With either, a given stage is left alone and another
    one is opened on its root layer. Raises :class:`Error` with the file for what cannot be opened.
    """
    if isinstance(stage, Usd.Stage):
        if mask is None and session_layer is None:
            return stage
        root, session = stage.GetRootLayer(), stage.GetSessionLayer()
        context = stage.GetPathResolverContext()
    else:
        name = os.fspath(stage)
        root, session = _open_layer(name), None
        context = Ar.GetResolver().CreateDefaultContextForAsset(root.realPath or name)
    if session_layer is not None:
        session = _open_layer(os.fspath(session_layer))
    population = Usd.StagePopulationMask.All()
    if mask is not None:
        paths = [mask] if isinstance(mask, str) else mask
        population = Usd.StagePopulationMask([_prim_path(path) for path in paths])
    try:
        return Usd.Stage.OpenMasked(root, session, context, population, Usd.Stage.LoadAll)
    except Tf.ErrorException as error:
        raise Error(f"{root.identifier}: {_reason(error)}") from None


def _open_layer(name: str) -> Sdf.Layer:
    if not name:
        raise UsageError("the name of the stage is empty")
    if os.path.isdir(name):
        raise Error(f"{name}: is a folder, not a USD file")
    if not Sdf.Layer.IsAnonymousLayerIdentifier(name) and not Ar.GetResolver().Resolve(name):
        raise Error(f"{name}: no such file")
    try:
        layer = Sdf.Layer.FindOrOpen(name)
    except Tf.ErrorException as error:
        raise Error(f"{name}: {_reason(error)}") from None
    if layer is None:
        raise Error(f"{name}: not a USD file, or a damaged one")
    return layer


def _prim_path(path: str) -> Sdf.Path:
    if not Sdf.Path.IsValidPathString(str(path)) or not Sdf.Path(str(path)).IsAbsolutePath():
        raise UsageError(f"not an absolute prim path: {str(path)!r}")
    return Sdf.Path(str(path))


_NOT_USD = f"not a USD file ({', '.join(EXTENSIONS)})"
OBSOLETE = "pip install 'usd-core<26.11' reads files of crate versions before 0.4.0"


def _reason(error: Tf.ErrorException) -> str:
    """Why USD could not open a layer, in one line."""
    errors = re.findall(
        r"Error in '.*?' at line \d+ in file \S+ : '(.*?)'\s*(?=\tError in|$)", str(error), re.S
    )
    messages = [" ".join(text.split()) for text in errors]
    messages = [text for text in messages if not text.startswith("Failed to open layer")]
    if not messages:
        return "not a USD file, or a damaged one"
    obsolete = re.search(r"obsolete version (\d+\.\d+\.\d+)", messages[-1])
    if obsolete:
        return f"a crate file of the obsolete version {obsolete[1]}; {OBSOLETE}"
    if "Cannot determine file format" in messages[-1]:
        return _NOT_USD
    where = re.sub(r"^.*?:(\d+):\d+: ", r"line \1: ", messages[-1])
    return f"not readable as USD: {re.sub(r'pxrInternal[^ ]*::', '', where)}"


@contextmanager
def usd_diagnostics(report: Report) -> Iterator[None]:
    """Turn what USD itself complains about into warnings of the report.

    Composition errors are warnings; the rest (which USD prints to stderr) goes to the debug log.
    """
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        complaints = delegate.TakeUncoalescedDiagnostics()
        del delegate
    for complaint in complaints:
        text = " ".join(complaint.commentary.split())
        if "_ReportErrors" in complaint.sourceFunction or "Pcp" in complaint.sourceFunction:
            text = re.sub(r"\.? \((instantiating|recomposing|getting).*$", "", text)
            if "obsolete version" in text:
                text += f" ({OBSOLETE})"
            report.warn("USD could not compose all of the stage", text)
        else:
            log.debug("USD: %s", text)


def time_code(stage: Usd.Stage, frame: float | None) -> Usd.TimeCode:
    """The time to read at: the frame; else the stage's start, if it has one, as usdrecord does;
    else the earliest samples."""
    if frame is not None:
        if not math.isfinite(frame):
            raise UsageError(f"frame must be a number, not {frame}")
        return Usd.TimeCode(float(frame))
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()
