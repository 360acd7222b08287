"""The pytest plugin, in test runs of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import usdmlt.stage  # runs within this process import it anew otherwise
import usdmlt.testing.checks  # noqa: F401

SCENE = Path(__file__).parents[2] / "scenes" / "cornell_box.usda"

TEST = f"""
from pxr import Usd
import usdmlt

SCENE = {str(SCENE)!r}
OPTIONS = dict(width=32, samples=24, integrator="path")

def stage():
    stage = Usd.Stage.Open(SCENE)
    stage.SetEditTarget(stage.GetSessionLayer())
    return stage
"""


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    """A folder with the plugin on, whether or not the package is installed."""
    pytester.makeconftest('pytest_plugins = ["usdmlt.testing.plugin"]')
    return pytester


def write(project: pytest.Pytester, body: str) -> None:
    project.makepyfile(test_picture=TEST + body)


def run(project: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    return project.runpytest_inprocess("-p", "no:cacheprovider", *arguments)


CHECK = """
def test_box(assert_render):
    assert_render(stage(), **OPTIONS)
"""


@pytest.fixture
def referenced(project: pytest.Pytester) -> pytest.Pytester:
    """With the reference that CHECK asks for."""
    write(project, CHECK)
    run(project, "--usdmlt-update").assert_outcomes(passed=1)
    return project


def test_a_missing_reference_fails_with_the_command_that_makes_it(
    project: pytest.Pytester,
) -> None:
    write(project, CHECK)
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "there is no reference references/box.exr",
            "  make it, and look at it: pytest test_picture.py::test_box --usdmlt-update",
        ]
    )
    assert not (project.path / "references").exists()


def test_a_reference_holds_no_path_of_the_machine(project: pytest.Pytester) -> None:
    (project.path / "box.usda").write_bytes(SCENE.read_bytes())
    write(project, CHECK.replace("stage()", '"box.usda"'))
    run(project, "--usdmlt-update").assert_outcomes(passed=1)
    from usdmlt.testing import references

    (reference,) = (project.path / "references").iterdir()
    assert references.read(reference).metadata["stage"] == "../box.usda"


def test_commands_are_told_for_the_folder_where_pytest_was_called(
    project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project.path / "pytest.ini").write_text("[pytest]\n")
    write(project, CHECK)
    (project.path / "inner").mkdir()
    (project.path / "test_picture.py").rename(project.path / "inner" / "test_picture.py")
    monkeypatch.chdir(project.path / "inner")
    result = run(project)
    result.stdout.fnmatch_lines(["*: pytest test_picture.py::test_box --usdmlt-update"])


def test_a_reference_that_was_made_is_met_bit_for_bit(project: pytest.Pytester) -> None:
    write(project, CHECK.replace("**OPTIONS", "exact=True, **OPTIONS"))
    run(project, "--usdmlt-update").assert_outcomes(passed=1)
    reference = project.path / "references" / "box.exr"
    made = reference.stat().st_mtime_ns
    run(project).assert_outcomes(passed=1)
    # What has not changed is not written again.
    run(project, "--usdmlt-update").assert_outcomes(passed=1)
    assert reference.stat().st_mtime_ns == made


def test_a_changed_stage_fails_and_says_how_and_is_in_the_report(
    referenced: pytest.Pytester,
) -> None:
    write(
        referenced,
        """
def test_box(assert_render):
    changed = stage()
    light = next(p for p in changed.Traverse() if p.HasAttribute("inputs:intensity"))
    light.GetAttribute("inputs:intensity").Set(1.05 * light.GetAttribute("inputs:intensity").Get())
    assert_render(changed, **OPTIONS)

def test_other(assert_render):
    assert_render(stage(), "box", **OPTIONS)
""",
    )
    result = run(referenced, "--usdmlt-report", "out")
    result.assert_outcomes(failed=1, passed=1)
    result.stdout.fnmatch_lines(
        [
            "the picture is not that of references/box.exr",
            "  brightness 1.0*",
            "  the stage is not the one of the reference",
            "  reproduce: pytest test_picture.py::test_box",
            "  accept: pytest test_picture.py::test_box --usdmlt-update",
            "usdmlt: report: out/index.html",
        ]
    )
    page = (referenced.path / "out" / "index.html").read_text()
    assert "test_picture.py::test_box" in page and "test_other" not in page
    assert [p.name for p in (referenced.path / "out").iterdir()] == ["index.html"]


def test_layers_of_surfaces_are_kept_and_met_bit_for_bit(project: pytest.Pytester) -> None:
    """A block that is moved by less than noise tells is seen in the depths."""
    check = """
def test_box(assert_render, usd_render):
    changed = stage()
    block = changed.GetPrimAtPath("/World/ShortBlock")
    points = block.GetAttribute("points")
    points.Set([(x, y, z - MOVED) for x, y, z in points.Get()])
    assert_render(usd_render(changed, stream=int(MOVED > 0), aovs=("Z", "objectId"), **OPTIONS))
"""
    write(project, "MOVED = 0.0\n" + check)
    run(project, "--usdmlt-update").assert_outcomes(passed=1)
    run(project).assert_outcomes(passed=1)
    write(project, "MOVED = 0.01\n" + check)
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["  the layer Z differs in * of 1024 pixels"])
    result.stdout.no_fnmatch_line("*brightness*pixels*")


def test_layers_of_light_paths_are_refused(project: pytest.Pytester) -> None:
    write(project, CHECK.replace("**OPTIONS", 'aovs="direct", **OPTIONS'))
    result = run(project)
    result.assert_outcomes(failed=1)
    result = run(project, "--usdmlt-update")
    result.stdout.fnmatch_lines(["*layers of light paths are no part of checks: direct"])


def test_a_change_that_does_not_show_passes(referenced: pytest.Pytester) -> None:
    """The bits differ, as a box far behind the camera takes other random numbers' places."""
    write(
        referenced,
        """
def test_box(assert_render, usd_render):
    assert_render(usd_render(stage(), stream=1, **OPTIONS))

def test_exact(assert_render, usd_render):
    assert_render(usd_render(stage(), stream=1, **OPTIONS), "box", exact=True)
""",
    )
    result = run(referenced)
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["*the bits differ, and exact=True asks for the same"])


def test_a_check_that_is_too_noisy_asks_for_samples(referenced: pytest.Pytester) -> None:
    write(
        referenced,
        """
def test_box(assert_render, usd_render):
    assert_render(usd_render(stage(), stream=1, **OPTIONS), detect=0.0005)
""",
    )
    result = run(referenced)
    result.assert_outcomes(failed=1)
    result.stdout.re_match_lines([r"  too noisy to tell: .* about samples=\d+, instead of 24.*"])


def test_a_size_that_changed_is_one_line(referenced: pytest.Pytester) -> None:
    write(referenced, CHECK.replace("**OPTIONS", "width=40, samples=24"))
    result = run(referenced)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*references/box.exr: the pictures differ in size: 32x* and 40x*"])


def test_checks_without_a_comparison_are_on_the_page(referenced: pytest.Pytester) -> None:
    """A size that changed with both pictures, a reference that is missing or broken."""
    (referenced.path / "references" / "broken.exr").write_bytes(b"no picture")
    write(
        referenced,
        """
import pytest

@pytest.mark.parametrize("name", ["box", "none", "broken"])
def test_it(name, assert_render):
    assert_render(stage(), name, width=40, samples=4)
""",
    )
    run(referenced, "--usdmlt-report", "out").assert_outcomes(failed=3)
    page = (referenced.path / "out" / "index.html").read_text()
    sections = page.split("<section")[1:]
    assert len(sections) == 3
    by_name = {
        name: x for x in sections for name in ("box", "none", "broken") if f": {name} <" in x
    }
    assert "differ in size: 32x" in by_name["box"] and by_name["box"].count("<img") == 2
    assert "there is no reference references/none.exr" in by_name["none"]
    assert "cannot read" in by_name["broken"] and "<img" not in by_name["broken"]
    assert all("--usdmlt-update" in x and "not compared" in x for x in sections)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("significance=1e-5", "significance must be at least 1.5e-05, not 1e-05*"),
        ("significance=2", "significance must be between 0 and 1, not 2"),
        ("detect=0", "detect must be positive, not 0"),
        ("fail=-1", "fail must not be negative, but is -1"),
    ],
)
def test_what_no_check_could_find_is_refused(
    referenced: pytest.Pytester, option: str, message: str
) -> None:
    body = CHECK.replace(
        "stage(), **OPTIONS", f"usd_render(stage(), stream=1, **OPTIONS), {option}"
    )
    write(referenced, body.replace("(assert_render)", "(assert_render, usd_render)"))
    result = run(referenced)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"*UsageError: {message}"])


@pytest.mark.parametrize("name", ["samples", "cell", "significance"])
def test_ini_options_that_make_no_sense_are_named(referenced: pytest.Pytester, name: str) -> None:
    result = run(referenced, "-o", f"usdmlt_{name}=0")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([f"*UsageError: *usdmlt_{name}*"])


def test_folders_that_cannot_be_written_are_one_line(project: pytest.Pytester) -> None:
    """A file is in their place: to root, all folders can be written."""
    (project.path / "file").touch()
    write(project, CHECK)
    result = run(project, "-o", "usdmlt_references=file/a", "--usdmlt-update")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*Error: cannot write file/a/box.exr: Not a directory"])
    result = run(project, "--usdmlt-report", "file/out")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["ERROR: --usdmlt-report: *Not a directory*"])


def test_pixels_that_are_not_finite_make_no_reference(project: pytest.Pytester) -> None:
    write(
        project,
        """
def test_box(assert_render, usd_render):
    picture = usd_render(stage(), **OPTIONS)
    picture.pictures[3, 4, 5] = float("nan")
    assert_render(picture)
""",
    )
    result = run(project, "--usdmlt-update")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*Error: 1 pixels are not finite, so this is no reference"])
    assert not list(project.path.rglob("*.exr"))


def test_references_of_other_versions_are_compared(referenced: pytest.Pytester) -> None:
    """One has settings that there are no more; what cannot be read says how to make it anew."""
    from dataclasses import replace

    from usdmlt.testing import references

    path = referenced.path / "references" / "box.exr"
    reference = references.read(path)
    made = reference.made | {"settings": reference.made["settings"] | {"forgotten": 3}}
    made["versions"] = made["versions"] | {"usdmlt": "0.0"}
    references.write(path, replace(reference, made=made, bits="others"), reference.cell)
    run(referenced).assert_outcomes(passed=1)
    path.write_bytes(path.read_bytes()[:1000])
    result = run(referenced)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "cannot read *box.exr*",
            "  make it anew: pytest test_picture.py::test_box --usdmlt-update",
        ]
    )
    run(referenced, "--usdmlt-update").assert_outcomes(passed=1)
    run(referenced).assert_outcomes(passed=1)


def test_ini_options(project: pytest.Pytester) -> None:
    project.makeini(
        "[pytest]\nusdmlt_references = kept/pictures\nusdmlt_samples = 24\nusdmlt_cell = 4"
    )
    write(project, "def test_box(assert_render):\n    assert_render(stage(), width=48)\n")
    run(project, "--usdmlt-update").assert_outcomes(passed=1)
    from usdmlt.testing import references

    reference = references.read(project.path / "kept" / "pictures" / "box.exr")
    assert reference.cell == 4 and reference.made["settings"]["samples"] == 24
    assert reference.made["options"] == {"width": 48}
    assert len(reference.made["stage_hash"]) == 64
    assert {"usdmlt", "build", "embree"} == reference.made["versions"].keys()
    run(project).assert_outcomes(passed=1)


def test_workers_share_the_processors_and_the_report(project: pytest.Pytester) -> None:
    pytest.importorskip("xdist")
    checks = """
import os
from usdmlt.settings import available_processors

def test_box(assert_render, usd_render):
    picture = usd_render(stage(), **OPTIONS)
    if "PYTEST_XDIST_WORKER" in os.environ:
        assert picture.stats["settings"]["threads"] == max(available_processors() // 2, 1)
    assert_render(picture)

def test_two(assert_render):
    assert_render(stage(), "two", **OPTIONS)
"""
    write(project, checks)
    run(project, "--usdmlt-update").assert_outcomes(passed=2)
    write(project, checks.replace("**OPTIONS", "depth=2, **OPTIONS"))
    run(project, "-n2", "--usdmlt-report", "out").assert_outcomes(failed=2)
    page = (project.path / "out" / "index.html").read_text()
    assert page.count("<section") == 2 and page.count("</html>") == 1


@pytest.mark.parametrize("name", ["../away", "", "/tmp/away"])
def test_names_stay_in_the_folder(project: pytest.Pytester, name: str) -> None:
    write(project, f"def test_box(assert_render):\n    assert_render(stage(), {name!r})\n")
    result = run(project)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"*{name!r} is no name of a reference*"])


def test_the_plugin_costs_nothing_until_it_is_used() -> None:
    """Loading it imports neither NumPy, nor USD, nor the core."""
    code = "import sys, usdmlt.testing.plugin; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = done.stdout.split()
    assert not {"numpy", "pxr", "usdmlt._core", "usdmlt.rendering", "OpenImageIO"} & set(loaded)
