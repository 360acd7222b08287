"""What is in a collection (UsdCollectionAPI)."""

from __future__ import annotations

from collections.abc import Hashable

from pxr import Sdf, Usd

LIGHT_LINK, SHADOW_LINK = "lightLink", "shadowLink"


class Collection:
    """The collection of a prim, and the rules that it comes to, other collections resolved."""

    def __init__(self, prim: Usd.Prim, name: str):
        collection = Usd.CollectionAPI(prim, name)
        self.query = collection.ComputeMembershipQuery()
        expression = collection.GetMembershipExpressionAttr().Get()
        self.by_expression = bool(
            expression and not expression.IsEmpty() and not self.query.UsesPathExpansionRuleMap()
        )
        self.rules = dict(self.query.GetAsPathExpansionRuleMap())
        everything = {Sdf.Path.absoluteRootPath: Usd.Tokens.expandPrims}
        self.has_all = not self.by_expression and self.rules == everything
        # Equal for collections of the same members; expressions are not compared.
        self.key: Hashable = collection.GetCollectionPath()
        if not self.by_expression:
            self.key = frozenset((path, str(rule)) for path, rule in self.rules.items())

    def has(self, path: Sdf.Path, drawn_by: tuple[Sdf.Path, ...] = ()) -> bool:
        """Whether it has the prim of a path, which prototypes of the point instancers ``drawn_by``
        hold: by the more specific of the rules about either."""
        if not drawn_by:
            return self.query.IsPathIncluded(path)
        if self.by_expression:
            return any(self.query.IsPathIncluded(p) for p in (path, *drawn_by))
        return self.query.IsPathIncluded(max((path, *reversed(drawn_by)), key=self._named_at))

    def _named_at(self, path: Sdf.Path) -> int:
        """How deep the rule is that decides about a path."""
        for prefix in reversed(path.GetPrefixes()):
            rule = self.rules.get(prefix)
            if rule is not None and (prefix == path or rule != Usd.Tokens.explicitOnly):
                return prefix.pathElementCount
        return 0


def is_authored(prim: Usd.Prim, name: str) -> bool:
    """Whether anything is said of a collection of a prim."""
    collection = Usd.CollectionAPI(prim, name)
    root, expression = collection.GetIncludeRootAttr(), collection.GetMembershipExpressionAttr()
    return bool(
        collection.GetIncludesRel().GetTargets()
        or collection.GetExcludesRel().GetTargets()
        or (root and root.HasAuthoredValue())
        or (expression and expression.HasAuthoredValue())
    )
