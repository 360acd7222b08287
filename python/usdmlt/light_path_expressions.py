"""Light path expressions: which paths of light a layer shows.

They are regular expressions over what happens to light between the camera and a light, as Open
Shading Language, Karma, Arnold and RenderMan have them. An event is one of

    <RD>  <RG>  <RS>  <TD>  <TG>  <TS>    V    <L.'key'>  <O.'key'>  <B.'key'>

reflection or transmission (R, T) by something diffuse, glossy or singular (D, G, S: perfectly
smooth); scattering in a volume (V); and at the end a light (L), an emissive surface (O) or an
environment that the camera sees directly (B), which may be told by its group or its prim path. A
letter alone is all events that have it, ``.`` any event. Expressions begin with the camera, C;
those that begin with L and end with E are Heckbert's, from the light to the eye: D is every vertex
on a surface that is not S there, L whatever emits. Both may have
``( ) | [ ] [^ ] * + ? {n} {n,} {n,m}``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import NoReturn, Union

import numpy as np
import numpy.typing as npt

from usdmlt.errors import UsageError

SCATTERINGS = ("RD", "RG", "RS", "TD", "TG", "TS", "V")
TERMINALS = ("L", "O", "B")
MOST_REPETITIONS = 100
MOST_STATES = 4096
MOST_EXPRESSIONS = 64  # bits of a mask


# ---------------------------------------------------------------------------------------------
# Expressions, and what is left of them after an event (Brzozowski 1964)


@dataclass(frozen=True)
class Event:
    """One event. ``of``: (name, what the light is called or None, whether it must not be called
    that); ``negated``: all but those."""

    of: frozenset[tuple[str, str | None, bool]]
    negated: bool = False

    def matches(self, name: str, called: Collection[str]) -> bool:
        """Whether it can be this one of SCATTERINGS and TERMINALS; ``called``: names of a light."""
        among = any(name == n and (c is None or (c in called) != but) for n, c, but in self.of)
        return among != self.negated


@dataclass(frozen=True)
class AnyOf:
    """One of them; one of none is no path at all."""

    parts: frozenset[Expression] = frozenset()


@dataclass(frozen=True)
class Then:
    """One after the other."""

    first: Expression
    second: Expression


@dataclass(frozen=True)
class Repeated:
    """Any number of times."""

    part: Expression


Expression = Union[Event, AnyOf, Then, Repeated]
NOTHING: Expression = AnyOf()
EMPTY: Expression = Repeated(NOTHING)


def either(*parts: Expression) -> Expression:
    """One of them, in the one form that all ways to write it have."""
    flat: set[Expression] = set()
    for part in parts:
        flat |= part.parts if isinstance(part, AnyOf) else {part}
    return flat.pop() if len(flat) == 1 else AnyOf(frozenset(flat))


def then(first: Expression, second: Expression) -> Expression:
    """One after the other, bracketed from the right."""
    if NOTHING in (first, second):
        return NOTHING
    if first == EMPTY or second == EMPTY:
        return second if first == EMPTY else first
    if isinstance(first, Then):
        return Then(first.first, then(first.second, second))
    return Then(first, second)


def may_end(expression: Expression) -> bool:
    """Whether it matches the empty path."""
    if isinstance(expression, Then):
        return may_end(expression.first) and may_end(expression.second)
    if isinstance(expression, AnyOf):
        return any(map(may_end, expression.parts))
    return isinstance(expression, Repeated)


def after(expression: Expression, name: str, called: Collection[str] = ()) -> Expression:
    """What has to follow the event."""
    if isinstance(expression, Event):
        return EMPTY if expression.matches(name, called) else NOTHING
    if isinstance(expression, AnyOf):
        return either(*(after(part, name, called) for part in expression.parts))
    if isinstance(expression, Repeated):
        return then(after(expression.part, name, called), expression)
    rest = then(after(expression.first, name, called), expression.second)
    if may_end(expression.first):
        return either(rest, after(expression.second, name, called))
    return rest


def reversed_(expression: Expression) -> Expression:
    """The same paths, told backwards."""
    if isinstance(expression, Then):
        return then(reversed_(expression.second), reversed_(expression.first))
    if isinstance(expression, AnyOf):
        return either(*map(reversed_, expression.parts))
    if isinstance(expression, Repeated):
        return Repeated(reversed_(expression.part))
    return expression


# ---------------------------------------------------------------------------------------------
# Automata


@dataclass(frozen=True)
class Automaton:
    """What a path belongs to, told from the camera on: state 0 is there.

    ``next`` (states, SCATTERINGS) uint16: the state after a scattering; ``masks`` (states,
    TERMINALS, kinds of lights) uint64: bit i of a path that ends so is set where expression i has
    it.
    """

    next: npt.NDArray[np.uint16]
    masks: npt.NDArray[np.uint64]


def compiled(
    expressions: Sequence[Expression], kinds: Sequence[Collection[str]] = ((),)
) -> Automaton:
    """One automaton for all expressions. ``kinds`` of lights: what those of each are called.

    Raises ValueError where it would be too large.
    """
    if len(expressions) > MOST_EXPRESSIONS:
        raise UsageError(f"at most {MOST_EXPRESSIONS} layers can be of light paths")
    states = {tuple(expressions): 0}
    follow, masks = [], []
    for state in (unseen := list(states)):
        row = []
        for name in SCATTERINGS:
            reached = tuple(after(expression, name) for expression in state)
            if reached not in states:
                states[reached] = len(states)
                unseen.append(reached)
                if len(states) > MOST_STATES:
                    raise UsageError("the light path expressions are too complicated together")
            row.append(states[reached])
        follow.append(row)
        masks.append(
            [
                [
                    sum(may_end(after(e, name, called)) << i for i, e in enumerate(state))
                    for called in kinds
                ]
                for name in TERMINALS
            ]
        )
    return Automaton(np.array(follow, np.uint16), np.array(masks, np.uint64))


# ---------------------------------------------------------------------------------------------
# Reading


def parse(text: str) -> Expression:
    """What follows the camera. Raises ValueError with the place of the first error."""
    return _Parser(text).whole()


EVENTS = frozenset((*SCATTERINGS, *TERMINALS))
_ROUGH = frozenset({"RD", "RG", "TD", "TG"})


class _Parser:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at, self.end = 0, len(text)
        self.from_light = text.startswith("L") and text.endswith("E")
        if self.from_light:
            self.at, self.end = 1, len(text) - 1
        letters = "DSV" if self.from_light else "RTDGSVLOB"
        self.letters = {letter: frozenset(e for e in EVENTS if letter in e) for letter in letters}
        self.letters["."] = EVENTS
        if self.from_light:
            self.letters["D"] = _ROUGH

    def whole(self) -> Expression:
        if not self.from_light and not self.accept("C"):
            self.fail("it has to begin with C, or with L and end with E")
        expression = self.choice()
        if self.at < self.end:
            self.fail(f"{self.peek()} closes nothing")
        if self.from_light:
            expression = then(reversed_(expression), _event(TERMINALS))
        if not compiled(
            [expression], [(), *((name,) for name in names_in(expression))]
        ).masks.any():
            self.fail("no path is of this kind: L, O or B has to be its last event")
        return expression

    def choice(self) -> Expression:
        parts = [self.sequence()]
        while self.accept("|"):
            parts.append(self.sequence())
        return either(*parts)

    def sequence(self) -> Expression:
        parts = []
        while self.peek() not in ("", "|", ")"):
            parts.append(self.repeated())
        return reduce(lambda rest, part: then(part, rest), reversed(parts), EMPTY)

    def repeated(self) -> Expression:
        part: Expression
        if self.peek() == "(":
            start = self.at
            self.at += 1
            part = self.choice()
            self.close(")", start)
        else:
            part = self.event()
        while self.peek() in ("*", "+", "?", "{"):
            if self.accept("*"):
                part = Repeated(part)
            elif self.accept("+"):
                part = then(part, Repeated(part))
            elif self.accept("?"):
                part = either(part, EMPTY)
            else:
                part = self.counted(part)
        return part

    def counted(self, part: Expression) -> Expression:
        """Of ``{n}``, ``{n,}`` or ``{n,m}``."""
        start = self.at
        self.at += 1
        least = self.number()
        most: int | None = least
        if self.accept(","):
            most = None if self.peek() == "}" else self.number()
        self.close("}", start)
        if most is None:
            rest: Expression = Repeated(part)
        elif most < least:
            self.fail(f"{most} is less than {least}", start)
        else:
            rest = EMPTY
            for _ in range(most - least):
                rest = either(EMPTY, then(part, rest))
        for _ in range(least):
            rest = then(part, rest)
        return rest

    def number(self) -> int:
        start = self.at
        while self.peek().isdecimal():
            self.at += 1
        if self.at == start:
            self.fail("a number is missing")
        number = int(self.text[start : self.at])
        if number > MOST_REPETITIONS:
            self.fail(f"at most {MOST_REPETITIONS} repetitions can be counted", start)
        return number

    def event(self) -> Event:
        start = self.at
        if self.accept("["):
            negated = self.accept("^")
            of = self.event().of
            while self.peek() not in ("", "]"):
                of |= self.event().of
            self.close("]", start)
            return Event(of, negated)
        if not self.from_light and self.accept("<"):
            return self.bracketed(start)
        return _event(self.letter())

    def bracketed(self, start: int) -> Event:
        """After ``<``: sets of letters, all of which an event has, and perhaps a light's name."""
        names = self.set_of_letters()
        while self.peek() not in ("", ">", "'") and not self.text.startswith("[^'", self.at):
            names &= self.set_of_letters()
        called, but, place = None, False, self.at
        if self.peek() in ("'", "["):
            but = self.accept("[^")
            called = self.label()
            if but:
                self.close("]", place)
            names &= frozenset(TERMINALS)
            if not names:
                self.fail("only lights can be told by a name", place)
        self.close(">", start)
        if not names:
            self.fail("there is no such event", start)
        return Event(frozenset((name, called, but) for name in names))

    def label(self) -> str:
        start = self.at
        self.accept("'")
        close = self.text.find("'", self.at)
        if close < 0:
            self.fail("' is never closed", start)
        label, self.at = self.text[self.at : close], close + 1
        return label

    def set_of_letters(self) -> frozenset[str]:
        start = self.at
        if not self.accept("["):
            return self.letter()
        negated = self.accept("^")
        names = self.letter()
        while self.peek() not in ("", "]"):
            names |= self.letter()
        self.close("]", start)
        return EVENTS - names if negated else names

    def letter(self) -> frozenset[str]:
        letter = self.peek()
        if letter not in self.letters:
            known = " ".join(self.letters)
            what = f"{letter} is no event" if letter else "an event is missing"
            self.fail(f"{what}: events are {known}")
        self.at += 1
        return self.letters[letter]

    def peek(self) -> str:
        return self.text[self.at] if self.at < self.end else ""

    def accept(self, text: str) -> bool:
        found = self.text.startswith(text, self.at, self.end)
        self.at += len(text) if found else 0
        return found

    def close(self, bracket: str, start: int) -> None:
        if self.accept(bracket):
            return
        if self.at >= self.end:
            self.fail(f"{self.text[start]} is never closed", start)
        self.fail(f"{bracket} is missing")

    def fail(self, message: str, at: int | None = None) -> NoReturn:
        place = (self.at if at is None else at) + 1
        raise UsageError(f"light path expression {self.text!r}, character {place}: {message}")


def names_in(expression: Expression) -> set[str]:
    """What lights are called in it."""
    if isinstance(expression, Event):
        return {called for _, called, _ in expression.of if called is not None}
    if isinstance(expression, AnyOf):
        return set().union(*map(names_in, expression.parts))
    if isinstance(expression, Then):
        return names_in(expression.first) | names_in(expression.second)
    return names_in(expression.part)


def _event(names: Iterable[str]) -> Event:
    return Event(frozenset((name, None, False) for name in names))
