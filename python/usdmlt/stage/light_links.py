"""Light linking: the ``collection:lightLink`` of lights, and which meshes are in them.

What a collection has of an instance is what it says of the paths inside of it (its proxies), so
that instances which it tells apart do not share a group. A prototype of a point instancer is where
its prims are; where it lies outside of the instancer, the more specific of the rules that name it
and the instancer decides, so that either may be linked.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator

from pxr import Sdf, Usd, UsdLux

from usdmlt.stage.membership import LIGHT_LINK, Collection, is_authored
from usdmlt.stage.traversal import CHILDREN, Group


class LightLinks:
    """The collections that lights are linked to; false where there are none.

    ``lights``: prims that may be linked. Lights that are linked to the same share a collection,
    named after the first of them.
    """

    def __init__(self, lights: Iterable[Usd.Prim] = ()):
        self._collections: dict[str, Collection] = {}
        self._of_light: dict[Sdf.Path, str] = {}
        self._lights_below: dict[Sdf.Path, list[tuple[Sdf.Path, str]]] = {}
        names: dict[Hashable, str] = {}
        for light in lights:
            collection = Collection(light, LIGHT_LINK)
            path = light.GetPath()
            if collection.has_all or path in self._of_light:
                continue
            name = names.setdefault(collection.key, f"{path}.collection:{LIGHT_LINK}")
            self._collections.setdefault(name, collection)
            self._of_light[path] = name
            for above in path.GetParentPath().GetPrefixes():
                below = (path.MakeRelativePath(above), name)
                self._lights_below.setdefault(above, []).append(below)
        rules = (path for collection in self._collections.values() for path in collection.rules)
        self._named_inside = {above for path in rules for above in path.GetPrefixes()[:-1]}
        self._by_expression = any(c.by_expression for c in self._collections.values())

    def __bool__(self) -> bool:
        return bool(self._collections)

    def collections_of(self, path: Sdf.Path, drawn_by: tuple[Sdf.Path, ...]) -> frozenset[str]:
        """The collections that have a prim, which prototypes of the point instancers ``drawn_by``
        hold."""
        return frozenset(n for n, c in self._collections.items() if c.has(path, drawn_by))

    def seen_inside(self, instance: Usd.Prim, drawn_by: tuple[Sdf.Path, ...]) -> Hashable:
        """What links tell of the inside of an instance: equal for those that are lit alike."""
        path = instance.GetPath()
        lights = tuple(self._lights_below.get(path, ()))
        if path in self._named_inside or self._by_expression:
            inside = (prim.GetPath() for prim in Usd.PrimRange(instance, CHILDREN))
            return (lights, *(self.collections_of(p, drawn_by) for p in inside))
        return (lights, self.collections_of(path.AppendChild("inside"), drawn_by))

    def apply(self, group: Group) -> None:
        """Note in the meshes and lights that were read of a group what they are linked to."""
        if not self:
            return
        for mesh in group.scene_meshes:
            path = Sdf.Path(mesh.name)
            mesh.collections = self.collections_of(path, group.drawn_by)
            mesh.light_link = self._of_light.get(path)
        for light in group.scene_lights:
            light.light_link = self._of_light.get(Sdf.Path(light.name))


def linked_lights(stage: Usd.Stage, groups: list[Group]) -> Iterator[Usd.Prim]:
    """The lights of a stage that may be linked. Where there are any in instances, those of all."""
    placed = [p.prim for group in groups for p in (*group.lights, *group.gprims)]
    found = [prim for prim in placed if _may_be_linked(prim)]
    yield from found
    if any(prim.IsInstanceProxy() for prim in found):
        everything = Usd.PrimRange(stage.GetPseudoRoot(), CHILDREN)
        yield from (prim for prim in everything if _may_be_linked(prim))


def _may_be_linked(prim: Usd.Prim) -> bool:
    return prim.HasAPI(UsdLux.LightAPI) and is_authored(prim, LIGHT_LINK)
