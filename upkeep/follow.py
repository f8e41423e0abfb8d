"""Be one parameter of a function and follow the calls that pass it on, as a reader does who asks what becomes of it.

The trip goes through a function's statements in the order of the source and enters each function of the project that is
passed the parameter, a part of it (`config.loss`, an item of it in a loop) or what such a function returned of it. Each
function is entered once; upkeep/walk.py says how a call is resolved. The trip ends where the parameter is put into an
object (who reads it there asks the object), where a library computes something of it, and where it is only compared or
printed.

A stay is a row of entered functions of one file; a return is a stay in a file that the trip had left.
"""

import ast
from dataclasses import dataclass, field
from itertools import groupby

from upkeep.names import Function
from upkeep.walk import Index, Place

COMPREHENSION = (ast.ListComp, ast.SetComp, ast.GeneratorExp, ast.DictComp)
NOT_IT = (ast.Compare, ast.JoinedStr)  # what is made of it is a truth value or a text


def follow(index: Index, start: Place, parameter: str) -> tuple[int, int]:
    """How many files a parameter of a function passes through, and how often it returns to one that it had left."""
    trip = Trip(index)
    trip.enter(start, {parameter})
    stays = [file for file, _ in groupby(trip.files)]
    return len(set(stays)), len(stays) - len(set(stays))


def parameters_of(function: ast.AST) -> list[str]:
    """Names of those that are passed by position."""
    assert isinstance(function, Function)
    return [argument.arg for argument in function.args.posonlyargs + function.args.args]


@dataclass
class Trip:
    """What has been passed through so far."""

    index: Index
    files: list[str] = field(default_factory=list)  # of each function, as they are entered
    handed_back: dict[Place, bool] = field(default_factory=dict)  # by function: it returns what is followed

    def enter(self, place: Place, names: set[str]) -> bool:
        """Whether a function returns what it was passed under these names."""
        if place not in self.handed_back:
            self.handed_back[place] = False
            self.files.append(place[0])
            of = _Reading(self, place, set(names))
            of.read(self.index.functions[place].body)  # type: ignore[attr-defined]
            self.handed_back[place] = of.returned
        return self.handed_back[place]


@dataclass
class _Reading:
    """Of one function. names: those under which it has what is followed."""

    trip: Trip
    place: Place
    names: set[str]
    returned: bool = False

    def read(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            for _, value in ast.iter_fields(statement):
                for part in value if isinstance(value, list) else [value]:
                    if isinstance(part, ast.stmt):
                        self.read([part])
                    elif isinstance(part, ast.withitem):
                        self._bind(part.optional_vars, self.has(part.context_expr))
                    elif isinstance(part, (ast.ExceptHandler, ast.match_case)):
                        self.read(part.body)
                    elif isinstance(part, ast.expr) and not isinstance(getattr(part, "ctx", None), ast.Store):
                        self._expression(statement, part)

    def _expression(self, statement: ast.stmt, part: ast.expr) -> None:
        has = self.has(part)
        if isinstance(statement, ast.Return):
            self.returned |= has
        elif isinstance(statement, (ast.Assign, ast.AnnAssign, ast.AugAssign)) and part is statement.value:
            for target in statement.targets if isinstance(statement, ast.Assign) else [statement.target]:
                self._bind(target, has)
        elif isinstance(statement, (ast.For, ast.AsyncFor)) and part is statement.iter:
            self._bind(statement.target, has)

    def _bind(self, target: ast.expr | None, has: bool) -> None:
        if has and target:
            self.names |= {node.id for node in ast.walk(target) if isinstance(node, ast.Name)} - {"self", "_"}

    def has(self, node: ast.AST) -> bool:
        """Whether an expression is what is followed, or a part of it. Enters the functions that are passed it."""
        if isinstance(node, ast.Name):
            return node.id in self.names
        if isinstance(node, ast.Call):
            return self._call(node)
        if isinstance(node, COMPREHENSION):
            for loop in node.generators:
                self._bind(loop.target, self.has(loop.iter))
                for condition in loop.ifs:
                    self.has(condition)
            values = [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
            return any([self.has(value) for value in values])
        if isinstance(node, ast.NamedExpr):
            self._bind(node.target, has := self.has(node.value))
            return has
        if isinstance(node, ast.Subscript):
            self.has(node.slice)
            return self.has(node.value)
        parts = [self.has(part) for part in ast.iter_child_nodes(node)]
        return any(parts) and not isinstance(node, NOT_IT)

    def _call(self, node: ast.Call) -> bool:
        receiver = isinstance(node.func, ast.Attribute) and self.has(node.func.value)
        passed = [self.has(argument) for argument in node.args]
        named = {word.arg: self.has(word.value) for word in node.keywords}
        if not any([receiver, *passed, *named.values()]):
            return False
        target = self.trip.index.resolve(self.place, node.func)
        if target is None:  # a method of it, or a built-in function: sorted(trials)
            return receiver or (isinstance(node.func, ast.Name) and node.func.id.islower())
        return self.trip.enter(target, self._parameters(target, receiver, passed, named))

    def _parameters(self, target: Place, receiver: bool, passed: list[bool], named: dict) -> set[str]:
        """Under which names a function has it."""
        names = parameters_of(self.trip.index.functions[target])
        method = bool(names) and names[0] in ("self", "cls")
        has = {name for name, there in [*zip(names[method:], passed, strict=False), *named.items()] if there and name}
        return has | ({"self"} if receiver and method else set())
