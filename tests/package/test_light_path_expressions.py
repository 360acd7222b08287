"""Light path expressions: what they match, and what is said of those that cannot be read."""

from __future__ import annotations

import itertools
import re

import pytest

from usdmlt.light_path_expressions import SCATTERINGS, TERMINALS, Automaton, compiled, parse

KINDS = (("",), ("key",), ("fill",))


def masks_of(automaton: Automaton, path: tuple[str, ...], terminal: str, group: str = "") -> int:
    state = 0
    for scattering in path:
        state = automaton.next[state, SCATTERINGS.index(scattering)]
    return int(automaton.masks[state, TERMINALS.index(terminal), KINDS.index((group,))])


def matches(expression: str, path: str, group: str = "") -> bool:
    """``path``: events between the camera and the terminal, which is its last word."""
    *scatterings, terminal = path.split()
    automaton = compiled([parse(expression)], KINDS)
    return bool(masks_of(automaton, tuple(scatterings), terminal, group))


@pytest.mark.parametrize(
    ("expression", "matching", "others"),
    [
        ("CL", ["L"], ["O", "B", "RD L"]),
        ("C<RD>L", ["RD L"], ["L", "RG L", "TD L", "RD RD L", "RD O"]),
        ("C<TS>+<RD>L", ["TS RD L", "TS TS RD L"], ["RD L", "RS RD L", "TS RD RD L"]),
        ("C.*", ["L", "O", "B", "RD TS L"], []),
        ("CD[LO]", ["RD L", "TD O"], ["RG L", "RD B"]),
        ("C<.[GS]>*L", ["L", "RG TS L"], ["RD L"]),
        ("C[^D]L", ["RG L", "TS L"], ["RD L", "TD L"]),
        ("C<R[^S]>L", ["RD L", "RG L"], ["RS L", "TD L"]),
        ("C(<RD>|<TS><TS>)L", ["RD L", "TS TS L"], ["TS L"]),
        ("CS{2}L", ["RS TS L"], ["RS L", "RS RS RS L"]),
        ("CS{1,2}D?L", ["RS L", "RS RS RD L"], ["RD L", "RS RS RS L"]),
        ("CS{2,}L", ["RS RS L", "RS RS RS RS L"], ["RS L"]),
        ("LE", ["L", "O", "B"], ["RD L"]),
        ("LS+DE", ["RD TS L", "RG RS RS O"], ["RD L", "TS RD L", "RD RD TS L"]),
        ("L(D|S)*E", ["L", "RD L", "TS RG O"], ["V L"]),
    ],
)
def test_an_expression_matches_its_paths_and_no_others(expression, matching, others):
    assert [path for path in matching if not matches(expression, path)] == []
    assert [path for path in others if matches(expression, path)] == []


def test_the_group_of_a_light_tells_it_from_others():
    assert matches("C.*<L.'key'>", "RD L", "key")
    assert not matches("C.*<L.'key'>", "RD L", "fill")
    assert not matches("C.*<L.'key'>", "RD O", "key")
    assert matches("C.*<L.[^'key']>", "RD L", "fill") and matches("C.*<L.[^'key']>", "L")
    assert not matches("C.*<L.[^'key']>", "L", "key")
    assert not matches("C.*<L.'unheard of'>", "L", "key")


def test_a_matcher_of_strings_agrees_on_all_short_paths():
    """Python's regular expressions, on a letter for each event, are an implementation apart."""
    letters = dict(zip((*SCATTERINGS, *TERMINALS), "abcdefghij", strict=True))
    expressions = {
        "C<RD>.*[LOB]": "a.*[hij]",
        "C(<.S>|V)+<R.>{0,2}[^LV]": "([cf]|g)+[abc]{0,2}[^gh]",
        "L[SV]*D+S?E": "[cf]?[abde]+[cfg]*[hij]",
        "C(<T[DG]>?V)*O": "([de]?g)*i",
    }
    automaton = compiled([parse(text) for text in expressions], KINDS)
    for length in range(4):
        for path in itertools.product(SCATTERINGS, repeat=length):
            for terminal in TERMINALS:
                spelled = "".join(letters[event] for event in (*path, terminal))
                expected = sum(
                    bool(re.fullmatch(pattern, spelled)) << i
                    for i, pattern in enumerate(expressions.values())
                )
                assert masks_of(automaton, path, terminal) == expected, spelled


@pytest.mark.parametrize(
    ("expression", "character", "message"),
    [
        ("", 1, "begin with C"),
        ("RDL", 1, "begin with C"),
        ("CQL", 2, "Q is no event"),
        ("C<RD", 2, "< is never closed"),
        ("C(RL", 2, "( is never closed"),
        ("C[RL", 2, "[ is never closed"),
        ("CRL)", 4, ") closes nothing"),
        ("C<RLL>L", 2, "no such event"),
        ("C*L", 2, "* is no event"),
        ("C.{3,2}L", 3, "2 is less than 3"),
        ("C.{,3}L", 4, "a number is missing"),
        ("C.{999}L", 4, "at most 100"),
        ("C<RD'coat'>L", 5, "only lights can be told by a name"),
        ("C.*<L.'key>", 7, "' is never closed"),
        ("CD", 3, "has to be its last event"),
        ("CLD", 4, "has to be its last event"),
        ("LS+RE", 4, "R is no event: events are D S V ."),
    ],
)
def test_an_error_is_pointed_at(expression, character, message):
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        parse(expression)
    assert f"character {character}:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_too_much_is_refused():
    with pytest.raises(ValueError, match="at most 64"):
        compiled([parse("CL")] * 65)
    with pytest.raises(ValueError, match="too complicated"):
        compiled([parse("C.*D.{20}L")])
