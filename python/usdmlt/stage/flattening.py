"""Groups placed in the world: nested instances become (prototype, transforms to the world).

Point instances may have primvars of their own. They are the same to a prototype as constant
primvars inherited from above, so instances of equal values share a copy of the prototype.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from usdmlt.errors import Error, Report
from usdmlt.scene import Instances, Light, Mesh, Primvar, Prototype, Volume
from usdmlt.stage.light_motion import place_light
from usdmlt.stage.materials import Materials
from usdmlt.stage.motion import composed, moving_instances, settled
from usdmlt.stage.traversal import Group, Placements
from usdmlt.stage.volumes import place as place_volume

# Copies of a prototype for different values: at most so many triangles in all, within these limits.
COPIED_TRIANGLES = 1 << 22
COPIES = (16, 4096)


@dataclass
class Flat:
    """Everything in world space."""

    meshes: list[Mesh] = field(default_factory=list)
    prototypes: list[Prototype] = field(default_factory=list)
    instances: list[Instances] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    volumes: list[Volume] = field(default_factory=list)


def flatten(groups: list[Group], materials: Materials, report: Report) -> Flat:
    """Groups whose placements are known. What is placed once becomes plain meshes."""
    flat = Flat()
    for group in groups:
        transforms, motion = group.placements.transforms, group.placements.motion
        for light, placed in zip(group.scene_lights, group.lights, strict=True):
            flat.lights += place_light(light, placed, group.placements, report)
        for mesh in group.scene_volumes:
            flat.volumes += place_volume(mesh, transforms, motion, materials.media)
        for meshes, chosen in _by_values(group, materials, report):
            moving = None if motion is None else motion[:, chosen]
            _add(flat, group.name, meshes, transforms[chosen], moving, report)
    return flat


def _add(
    flat: Flat,
    name: str,
    meshes: list[Mesh],
    transforms: np.ndarray,
    motion: np.ndarray | None,
    report: Report,
) -> None:
    if len(transforms) == 1:
        own = None if motion is None else motion[:, 0]
        place = None if np.array_equal(transforms[0], np.eye(4)) else transforms[0]
        flat.meshes += [settled(mesh, place, own) for mesh in meshes]
    elif meshes and len(transforms):
        flat.instances += moving_instances(len(flat.prototypes), transforms, motion, name, report)
        flat.prototypes.append(Prototype([settled(mesh) for mesh in meshes], name=name))


def _by_values(
    group: Group, materials: Materials, report: Report
) -> list[tuple[list[Mesh], np.ndarray | slice]]:
    """The meshes of a group as they look in each of its placements, and in which ones so."""
    if not group.placements.values:
        return [(group.scene_meshes, slice(None))]
    read: set[str] = set()
    for mesh in group.scene_meshes:
        for index in np.unique(mesh.materials).tolist():
            read.update(materials.primvars(index))
    names = sorted(name for name in group.placements.values if name in read)
    if not names:
        return [(group.scene_meshes, slice(None))]
    columns = [group.placements.values[name] for name in names]
    table = np.concatenate(columns, axis=1)
    triangles = sum(len(mesh.triangles) for mesh in group.scene_meshes)
    limit = int(np.clip(COPIED_TRIANGLES // max(triangles, 1), *COPIES))
    kind, representative = _few_kinds(table, limit, group.name, report)
    ends = np.cumsum([column.shape[1] for column in columns])[:-1]
    order = np.argsort(kind, kind="stable")
    pieces = np.split(order, np.cumsum(np.bincount(kind))[:-1])
    found = []
    for chosen, row in zip(pieces, representative, strict=True):
        values = dict(zip(names, np.split(row, ends), strict=True))
        found.append(([_with_values(m, values, materials) for m in group.scene_meshes], chosen))
    return found


def _with_values(mesh: Mesh, values: dict[str, np.ndarray], materials: Materials) -> Mesh:
    """A mesh that inherits values; its own primvars are stronger, NaN is no value."""
    reads = set().union(*(materials.primvars(i) for i in np.unique(mesh.materials).tolist()))
    inherited = {
        name: Primvar(value[None].astype(np.float32), np.zeros_like(mesh.triangles))
        for name, value in values.items()
        if name in reads and not np.isnan(value).any()
    }
    return replace(mesh, primvars={**inherited, **mesh.primvars})


def _few_kinds(
    table: np.ndarray, limit: int, name: str, report: Report
) -> tuple[np.ndarray, np.ndarray]:
    """Which of at most ``limit`` kinds each row of ``table`` is, and the mean row of each kind."""
    kind = _distinct(table)
    number = int(kind.max()) + 1
    steps = 256
    low = np.nanmin(table, axis=0, initial=np.inf)
    span = np.nanmax(table, axis=0, initial=-np.inf) - low
    while number > limit and steps > 1:
        rounded = np.round((table - low) / np.where(span > 0, span, 1) * steps)
        kind = _distinct(rounded)
        number = int(kind.max()) + 1
        steps -= max(steps // 8, 1)
        if number <= limit:
            report.note(
                "primvars that differ between many point instances are rounded",
                f"{name} ({number})",
            )
    size = np.bincount(kind)
    mean = [np.bincount(kind, column) / size for column in table.T]
    return kind, np.stack(mean, axis=1)


def _distinct(table: np.ndarray) -> np.ndarray:
    """(rows,) numbers that are equal where rows are; NaN equals NaN."""
    kind = np.zeros(len(table), dtype=np.int64)
    for column in np.nan_to_num(table, nan=-3e38).T:
        _, index = np.unique(column, return_inverse=True)
        _, kind = np.unique(kind * (index.max() + 1) + index.ravel(), return_inverse=True)
        kind = kind.ravel()
    return kind


# ---------------------------------------------------------------------------------------------
# Where groups are


def place(world: Group) -> None:
    """Find the world transforms of all groups below the world. Raises :class:`Error` for an
    instancer that is one of its own prototypes."""
    found: dict[int, tuple[Group, list[Placements]]] = {}
    _place_below(world, Placements(np.eye(4)[None]), found, [])
    for group, pieces in found.values():
        group.placements = _joined(pieces)


def _place_below(
    group: Group,
    placements: Placements,
    found: dict[int, tuple[Group, list[Placements]]],
    inside: list[Group],
) -> None:
    """Record where a group is, and everything below it."""
    if any(group is outer for outer in inside):
        raise Error(f"{group.name}: a prototype that contains itself")
    found.setdefault(id(group), (group, []))[1].append(placements)
    by_child: dict[int, tuple[Group, list[Placements]]] = {}
    for child, local in group.children:
        by_child.setdefault(id(child), (child, []))[1].append(local)
    for child, pieces in by_child.values():
        _place_below(child, _nested(_joined(pieces), placements), found, [*inside, group])


def _nested(inner: Placements, outer: Placements) -> Placements:
    """Every inner placement in every outer one; inner values are stronger."""
    transforms = (inner.transforms[None] @ outer.transforms[:, None]).reshape(-1, 4, 4)
    values = {
        name: np.repeat(value, len(inner.transforms), axis=0)
        for name, value in outer.values.items()
    }
    for name, value in inner.values.items():
        repeated = np.tile(value, (len(outer.transforms), 1))
        above = values.get(name)
        if above is not None and above.shape == repeated.shape:
            repeated = np.where(np.isnan(repeated), above, repeated)
        values[name] = repeated
    motion = composed(inner.transforms, inner.motion, outer.transforms, outer.motion)
    return Placements(transforms, values, motion)


def _joined(pieces: list[Placements]) -> Placements:
    """One after the other; a name that a piece lacks is NaN there."""
    if len(pieces) == 1:
        return pieces[0]
    widths = {name: value.shape[1] for piece in pieces for name, value in piece.values.items()}
    values = {}
    for name, width in widths.items():
        columns = [piece.values.get(name) for piece in pieces]
        values[name] = np.concatenate(
            [
                np.full((len(piece.transforms), width), np.nan)
                if value is None or value.shape[1] != width
                else value
                for piece, value in zip(pieces, columns, strict=True)
            ]
        )
    transforms = np.concatenate([piece.transforms for piece in pieces])
    motion = None
    times = next((len(piece.motion) for piece in pieces if piece.motion is not None), 0)
    if times:
        motions = [
            np.repeat(piece.transforms[None], times, axis=0)
            if piece.motion is None
            else piece.motion
            for piece in pieces
        ]
        motion = np.concatenate(motions, axis=1)
    return Placements(transforms, values, motion)
