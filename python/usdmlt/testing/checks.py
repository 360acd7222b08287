"""What the fixtures of the pytest plugin do."""

from __future__ import annotations

import math
import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from usdmlt.errors import Error, UsageError
from usdmlt.image import Image
from usdmlt.settings import Settings
from usdmlt.testing import comparison, fragments, references, report
from usdmlt.testing.batches import Batches, render_batches
from usdmlt.testing.comparison import Comparison
from usdmlt.testing.metrics import Thresholds
from usdmlt.testing.statistics import BATCHES

THRESHOLDS = tuple(field.name for field in fields(Thresholds))


@dataclass
class Check:
    """The checks of one test.

    ``folder``: of the references. ``root``: where pytest was started. ``samples``, ``cell``: of
    references that are made; ``threads``: of renders, None: all.
    """

    test: str
    folder: Path
    root: Path
    default_name: str
    samples: int
    cell: int
    significance: float
    threads: int | None
    update: bool
    report: Path | None

    def render(self, stage: Any, **options: Any) -> Batches:
        """The picture of a stage."""
        if not {"samples", "mutations"} & options.keys():
            options["samples"] = self.samples
        options.setdefault("threads", self.threads)
        return render_batches(stage, **options)

    def assert_render(
        self,
        stage_or_image: Any,
        name: str | None = None,
        *,
        detect: float | None = None,
        exact: bool = False,
        significance: float | None = None,
        flip: float | None = None,
        **options: Any,
    ) -> None:
        """Fail the test unless the picture is that of the reference."""
        __tracebackhide__ = True
        name = self.default_name if name is None else name
        path = self._path(name)
        given = {key: options.pop(key) for key in THRESHOLDS if key in options}
        thresholds = Thresholds(**given) if given else None
        significance = self.significance if significance is None else significance
        if detect is not None and not detect > 0:
            raise UsageError(f"detect must be positive, not {detect:g}")
        if isinstance(stage_or_image, Image) and options:
            raise UsageError(f"a picture is rendered already: {', '.join(options)} cannot be set")
        if not path.exists() and not self.update:
            self._stop(
                path, f"there is no reference {self._shown(path)}", "make it, and look at it"
            )
        reference = self._reference(path)
        picture = self._picture(stage_or_image, reference, options)
        if self.update:
            self._write(path, picture, reference)
            return
        assert reference is not None
        if picture["color"].shape != reference["color"].shape:
            sizes = [f"{x.width}x{x.height}" for x in (reference, picture)]
            self._stop(
                path,
                f"{self._shown(path)}: the pictures differ in size: {sizes[0]} and {sizes[1]}",
                "accept",
                reference=reference,
                picture=picture,
            )
        result = comparison.compare(
            reference, picture, significance=significance, thresholds=thresholds, flip=flip
        )
        if exact and result.method != "same bits":
            result.reasons.insert(0, "the bits differ, and exact=True asks for the same")
        if not result.different:
            self._ask_for_power(result, detect, reference)
        if result.different:
            self._fail(path, result, reference, picture)

    def _reference(self, path: Path) -> Batches | None:
        """None where there is none, or none that can be read and that is to be made anew."""
        __tracebackhide__ = True
        problem = ""
        if path.exists():
            try:
                return references.read(path)
            except Error as error:
                problem = str(error)
        if problem and not self.update:
            self._stop(path, problem, "make it anew")
        return None

    def _stop(self, path: Path, problem: str, remedy: str, **pictures: Image) -> None:
        """Fail without a comparison; the remedy is to update."""
        __tracebackhide__ = True
        commands = {remedy: self._command(UPDATE)}
        if self.report is not None:
            failure = report.Failure(f"{self.test}: {path.stem}", problem, commands, pictures)
            fragments.add(self.report, failure.name, report.failure_section(failure))
        pytest.fail(f"{problem}\n  {remedy}: {commands[remedy]}", pytrace=False)

    def _picture(
        self, stage_or_image: Any, reference: Batches | None, options: Mapping[str, Any]
    ) -> Image:
        if isinstance(stage_or_image, Image):
            return stage_or_image
        before = as_before(reference, self.update)
        own = dict(options)
        if "integrator" in before and own.get("integrator") == "auto":
            del own["integrator"]  # what was chosen then
        if "mutations" in own:
            before.pop("samples", None)
        return self.render(stage_or_image, **(before | own))

    def _write(self, path: Path, picture: Image, reference: Batches | None) -> None:
        if not isinstance(picture, Batches):
            raise UsageError("a reference is made of a stage, or of what usd_render returned")
        same = reference is not None and reference.bits == picture.bits
        if same and reference is not None and reference.made == picture.made:
            return
        broken = int(np.count_nonzero(~np.isfinite(picture.pictures).all(axis=(0, -1))))
        if broken:
            raise Error(f"{broken} pixels are not finite, so this is no reference")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Error(f"cannot write {self._shown(path)}: {error.strerror}") from None
        references.write(path, picture, self.cell)

    def _ask_for_power(self, result: Comparison, detect: float | None, reference: Batches) -> None:
        """Where changes of the size ``detect`` would have gone unseen, that is a failure too."""
        outcome = result.outcome
        if detect is None or outcome is None or outcome.detectable <= detect:
            return
        reason = (
            f"too noisy to tell: {outcome.detectable:.2g} of the brightness would have been seen, "
            f"and detect={detect:g} is asked for"
        )
        samples = reference.made.get("settings", {}).get("samples")
        if samples and math.isfinite(outcome.detectable):
            wanted = math.ceil(samples * (outcome.detectable / detect) ** 2)
            reason += f": about samples={wanted}, instead of {samples}, and {UPDATE}"
        result.reasons.append(reason)

    def _fail(self, path: Path, result: Comparison, reference: Batches, picture: Image) -> None:
        __tracebackhide__ = True
        notes = provenance(reference, picture)
        commands = {"reproduce": self._command(), "accept": self._command(UPDATE)}
        lines = [f"the picture is not that of {self._shown(path)}", *result.lines(), *notes]
        lines += [f"{what}: {command}" for what, command in commands.items()]
        if self.report is not None:
            entry = report.Entry(f"{self.test}: {path.stem}", result, commands, notes)
            fragments.add(self.report, entry.name, report.section(entry))
        pytest.fail("\n  ".join(lines), pytrace=False)

    def _path(self, name: str) -> Path:
        path = Path(os.path.normpath(self.folder / f"{name}.exr"))
        if not name or not path.is_relative_to(os.path.normpath(self.folder)):
            raise UsageError(f"{name!r} is no name of a reference")
        return path

    def _shown(self, path: Path) -> str:
        """From where pytest was started, if it is below."""
        return str(path.relative_to(self.root)) if path.is_relative_to(self.root) else str(path)

    def _command(self, *flags: str) -> str:
        return shlex.join(["pytest", self.test, *flags])


UPDATE = "--usdmlt-update"


def as_before(reference: Batches | None, update: bool) -> dict[str, Any]:
    """Options that render as the reference was rendered; none when it is made anew."""
    if reference is None or update:
        return {}
    made: dict[str, Any] = reference.made
    known = {field.name for field in fields(Settings)}  # versions differ in these
    settings = {k: v for k, v in made.get("settings", {}).items() if v is not None and k in known}
    if settings.get("integrator") != "mlt":
        for name in ("mutation_weights", "direct", "selective", "two_stage"):
            settings.pop(name, None)
    before: dict[str, Any] = made.get("options", {}) | settings
    return before | {"batches": made.get("batches", BATCHES)}


def provenance(reference: Batches, picture: Image) -> list[str]:
    """What is different about how the two were made."""
    if not isinstance(picture, Batches):
        return []
    one, other = reference.made, picture.made
    lines = []
    if one.get("stage_hash") and other.get("stage_hash"):
        same = one["stage_hash"] == other["stage_hash"]
        lines.append(f"the stage is {'the one' if same else 'not the one'} of the reference")
    for name in ("versions", "settings"):
        old, new = one.get(name, {}), other.get(name, {})
        changed = [key for key in sorted(old.keys() | new.keys()) if old.get(key) != new.get(key)]
        lines += [f"{key} was {old.get(key)}, is {new.get(key)}" for key in changed]
    return lines
