"""Opening a stage, and choosing the time that is rendered."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from usdmlt.errors import Error, Report, UsageError
from usdmlt.options import LoadOptions
from usdmlt.stage.edits import choose_variants, keep_settings, session_over, set_values

log = logging.getLogger("usdmlt")

EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")


def open_stage(
    stage: Usd.Stage | str | os.PathLike[str], options: LoadOptions | None = None
) -> Usd.Stage:
    """The stage to read: the given one, or a file opened with all its payloads.

    With a mask, a session layer, variants, overrides or search paths a given stage is left alone
    and another one is opened on its root layer. Raises :class:`Error` with the file for what cannot
    be opened, and with the prim for edits of what is not there.
    """
    options = options or LoadOptions()
    edited = bool(options.variants or options.overrides)
    if isinstance(stage, Usd.Stage):
        asked = (options.mask, options.session_layer, options.search_paths or None)
        if not edited and all(option is None for option in asked):
            return stage
        root, session = stage.GetRootLayer(), stage.GetSessionLayer()
        population = stage.GetPopulationMask()
        context = stage.GetPathResolverContext()
        with Ar.ResolverContextBinder(context):
            context = _with_search_paths(context, options)
    else:
        name = os.fspath(stage)
        context = _with_search_paths(Ar.GetResolver().GetCurrentContext(), options)
        with Ar.ResolverContextBinder(context):
            root, session = _open_layer(name), None
        population = Usd.StagePopulationMask.All()
        if options.resolver == "root":
            context = _with_search_paths(
                Ar.GetResolver().CreateDefaultContextForAsset(root.realPath or name), options
            )
    if options.session_layer is not None:
        session = _open_layer(os.fspath(options.session_layer))
    if edited:
        session = session_over(session)
    if options.mask is not None:
        population = Usd.StagePopulationMask([_prim_path(path) for path in options.mask])
    try:
        opened = Usd.Stage.OpenMasked(root, session, context, population, Usd.Stage.LoadAll)
    except Tf.ErrorException as error:
        raise Error(f"{root.identifier}: {_reason(error)}") from None
    if isinstance(stage, Usd.Stage):
        keep_settings(stage, opened)
    choose_variants(opened, options.variants)
    set_values(opened, options.overrides)
    for path in options.mask or ():
        if not opened.GetPrimAtPath(path):
            raise Error(f"{path}: the mask asks for it, and there is no such prim")
    return opened


def _with_search_paths(context: Ar.ResolverContext, options: LoadOptions) -> Ar.ResolverContext:
    """A context that also looks in the folders asked for, after its own."""
    if not options.search_paths:
        return context
    own = [c.GetSearchPath() for c in context.Get() if isinstance(c, Ar.DefaultResolverContext)]
    added = [os.path.abspath(os.fspath(path)) for path in options.search_paths]
    for folder in added:
        if not os.path.isdir(folder):
            raise Error(f"{folder}: no such folder to search")
    return Ar.ResolverContext(Ar.DefaultResolverContext([*(own[0] if own else []), *added]))


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
    What USD raises, naming the prim, is an :class:`Error` of one line.
    """
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except Tf.ErrorException as error:
        raise Error("; ".join(" ".join(e.commentary.split()) for e in error.args)) from error
    finally:
        complaints = delegate.TakeUncoalescedDiagnostics()
        del delegate
    for complaint in complaints:
        text = " ".join(complaint.commentary.split())
        if "_ReportErrors" in complaint.sourceFunction or "Pcp" in complaint.sourceFunction:
            text = re.sub(r"\.? \((instantiating|recomposing|getting).*$", "", text)
            if "obsolete version" in text:
                text += f" ({OBSOLETE})"
            if ".mtlx@ for " not in text:  # composed otherwise, or warned of there
                report.warn("USD could not compose all of the stage", text)
        else:
            log.debug("USD: %s", text)


def time_code(stage: Usd.Stage, frame: float | str | None) -> Usd.TimeCode:
    """The time to read at: the frame, or the default time; else the stage's start, if it has one,
    as usdrecord does; else the earliest samples."""
    if frame == "default":
        return Usd.TimeCode.Default()
    if frame is not None:
        return Usd.TimeCode(float(frame))
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()
