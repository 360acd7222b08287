"""The pytest plugin: fixtures ``usd_render`` and ``assert_render``.

It is loaded by every pytest run of an environment that has usdmlt, so it imports nothing but pytest
until a test asks for a fixture.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from usdmlt.image import Image
    from usdmlt.testing.checks import Check

UPDATE = "--usdmlt-update"
REPORT = "--usdmlt-report"
INI = {
    "usdmlt_references": ("string", "references", "folder of references, from that of the test"),
    "usdmlt_samples": ("string", "72", "samples per pixel of a new reference"),
    "usdmlt_significance": ("string", "1e-4", "probability of a false alarm, by check"),
    "usdmlt_cell": ("string", "2", "pixels across of what references keep of batches"),
}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the flags and ini options."""
    group = parser.getgroup("usdmlt", "checks of rendered pictures")
    group.addoption(
        UPDATE, action="store_true", help="write the references that assert_render compares with"
    )
    group.addoption(REPORT, metavar="DIR", help="write DIR/index.html about the checks that failed")
    for name, (kind, default, text) in INI.items():
        parser.addini(name, text, type=kind, default=default)  # type: ignore[arg-type]


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Put the report together, in the process that started all others."""
    config = session.config
    folder = config.getoption(REPORT)
    if folder is None or hasattr(config, "workerinput"):
        return
    from usdmlt.testing.fragments import assemble

    session.config.stash[_REPORT] = assemble(Path(folder))


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say where the report is."""
    path = config.stash.get(_REPORT, None)
    if path is not None:
        terminalreporter.write_line(f"usdmlt: report: {path}")


def pytest_configure(config: pytest.Config) -> None:
    """Begin the report."""
    folder = config.getoption(REPORT)
    if folder is None or hasattr(config, "workerinput"):
        return
    from usdmlt.testing.fragments import begin

    try:
        begin(Path(folder))
    except OSError as error:
        raise pytest.UsageError(f"{REPORT}: {error}") from error


_REPORT = pytest.StashKey[Path]()


@pytest.fixture
def usd_render(request: pytest.FixtureRequest) -> Callable[..., Image]:
    """Render a stage to a picture that ``assert_render`` takes, or to look at it.

    ``usd_render(stage, camera=None, frame=None, width=None, samples=64, …)`` has the options of
    :func:`usdmlt.render` but ``time``; the picture is a :class:`usdmlt.Image` of independent
    batches. Under pytest-xdist the workers share the processors.
    """
    return _check(request).render


@pytest.fixture
def assert_render(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Check a picture against its reference.

    ``assert_render(stage_or_image, name=None, …)``: the reference is ``references/NAME.exr`` beside
    the test; without a name that of the test. A stage is rendered as the reference was, and with
    the same random numbers: what did not change gives the same bits. Options:

    ``detect``: relative change of the whole picture's brightness that the check has to be able to
    see; if it could not, it fails and says how many samples it needs. ``exact``: only the same bits
    pass. ``significance``: probability of a false alarm. ``fail``, ``failpercent``, ``hardfail``:
    `idiff`'s thresholds, ``flip``: the largest mean FLIP; these decide besides. All others are
    those of ``usd_render``.
    """
    return _check(request).assert_render


def _check(request: pytest.FixtureRequest) -> Check:
    from usdmlt.testing.checks import Check

    config = request.config
    report = config.getoption(REPORT)
    try:
        samples, cell = (int(config.getini(f"usdmlt_{name}")) for name in ("samples", "cell"))
        significance = float(config.getini("usdmlt_significance"))
    except ValueError as error:
        raise pytest.UsageError(f"usdmlt's ini options: {error}") from error
    if min(samples, cell) < 1 or not 0 < significance < 1:
        raise pytest.UsageError(
            "usdmlt_samples and usdmlt_cell must be at least 1, usdmlt_significance below 1, not "
            f"{samples}, {cell}, {significance:g}"
        )
    return Check(
        test=_test_from_here(request),
        folder=request.path.parent / config.getini("usdmlt_references"),
        root=config.invocation_params.dir,
        default_name=_default_name(request.node.name),
        samples=samples,
        cell=cell,
        significance=significance,
        threads=_threads(),
        update=config.getoption(UPDATE),
        report=None if report is None else Path(report),
    )


def _test_from_here(request: pytest.FixtureRequest) -> str:
    """The node's id as pytest takes it where it was called; that of the node is from the root."""
    file = Path(os.path.relpath(request.path, request.config.invocation_params.dir))
    return "::".join([file.as_posix(), *str(request.node.nodeid).split("::")[1:]])


def _default_name(test: str) -> str:
    """Of a test's name one of a file."""
    kept = [c if c.isalnum() or c in "._-" else "-" for c in test.removeprefix("test_")]
    return "".join(kept).strip("-.")


def _threads() -> int | None:
    """This worker's share of the processors; None: all."""
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1") or 1)
    if workers <= 1:
        return None
    from usdmlt.settings import available_processors

    return max(available_processors() // workers, 1)
