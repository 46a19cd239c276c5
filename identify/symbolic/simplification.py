"""The same expressions with fewer operations: sums and products with any number of terms, rearranged.

Exact algebra alone is used, so that the value stays what it was but for rounding: a − b and b − a are one
difference; single-use sums and products are flattened; a factor that terms of a sum share is taken out; and a pair of
terms or factors that occurs in several places is computed once (the most frequent first, as in Breuer 1969).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import combinations

from identify.symbolic.expression import OPERATIONS, Expression, Graph, Scalar, arguments, reachable
from identify.symbolic.operations import varying

Term = tuple[int, int]
"""A node of the table and the sign, ±1, with which it enters a sum."""

Rule = Callable[["Table", "Table", int, dict[int, Term]], Term]
"""(old table, new table, node of the old one, places of its children in the new one) → place in the new one."""


class Table:
    """Nodes ("leaf", index in the old graph), ("sum", terms), ("product", nodes), ("cos" | "sin", node), each once."""

    def __init__(self) -> None:
        self.nodes: list[tuple] = []
        self.index: dict[tuple, int] = {}
        self.constant: list[bool] = []

    def node(self, key: tuple, constant: bool) -> int:
        """Index of the node of this key, made if it is new; constant: whether nothing in it moves."""
        if key not in self.index:
            self.index[key] = len(self.nodes)
            self.nodes.append(key)
            self.constant.append(constant)
        return self.index[key]

    def total(self, terms: Iterable[Term]) -> Term:
        """The sum of the terms as a node and a sign; the first term has a plus."""
        ordered = sorted(terms)
        if len(ordered) == 1:
            return ordered[0]
        sign = ordered[0][1]
        key = ("sum", tuple((k, s * sign) for k, s in ordered))
        return self.node(key, all(self.constant[k] for k, _ in ordered)), sign

    def product(self, factors: Iterable[int]) -> int:
        """Index of the product of these nodes; of one alone, its own."""
        ordered = tuple(sorted(factors))
        if len(ordered) == 1:
            return ordered[0]
        return self.node(("product", ordered), all(self.constant[k] for k in ordered))

    def children(self, i: int) -> tuple[int, ...]:
        """Nodes that node i reads."""
        kind, *rest = self.nodes[i]
        if kind == "sum":
            return tuple(k for k, _ in rest[0])
        return () if kind == "leaf" else rest[0] if kind == "product" else (rest[0],)

    def live(self, roots: Iterable[int]) -> list[int]:
        """Nodes that the roots read, arguments before readers."""
        order: list[int] = []
        seen: set[int] = set()
        todo = [(i, False) for i in roots]
        while todo:
            i, done = todo.pop()
            if done:
                order.append(i)
            elif i not in seen:
                seen.add(i)
                todo.append((i, True))
                todo.extend((k, False) for k in self.children(i) if k not in seen)
        return order

    def uses(self, roots: Sequence[int]) -> Counter[int]:
        """How often each live node is read; outputs count as readers."""
        counted = Counter(roots)
        for i in self.live(roots):
            counted.update(self.children(i))
        return counted


def simplified(outputs: Sequence[Expression]) -> list[Expression]:
    """The outputs, in a new graph, with fewer operations by the chapter's convention."""
    if not outputs:
        return []
    old = outputs[0].graph
    table, roots = _signs_pulled_out(old, outputs)
    for step in (_flattened, _factored, _flattened, _factored, _shared):
        table, roots = step(table, roots)
    return _expressions(old, table, roots)


def _signs_pulled_out(old: Graph, outputs: Sequence[Expression]) -> tuple[Table, list[Term]]:
    """The expressions as a table of binary sums and products of unsigned nodes."""
    table = Table()
    order = reachable(old, outputs)
    variable = varying(old, order)
    place: dict[int, Term] = {}
    for i in order:
        node, x = old.nodes[i], [place[k] for k in arguments(old.nodes[i])]
        match node[0]:
            case "neg":
                place[i] = (x[0][0], -x[0][1])
            case "add" | "sub" if i in variable:
                second = x[1] if node[0] == "add" else (x[1][0], -x[1][1])
                place[i] = table.total([x[0], second])
            case "mul" if i in variable:
                place[i] = (table.product([x[0][0], x[1][0]]), x[0][1] * x[1][1])
            case "cos":
                place[i] = (table.node(("cos", x[0][0]), i not in variable), 1)
            case "sin":
                place[i] = (table.node(("sin", x[0][0]), i not in variable), x[0][1])
            case _:
                place[i] = (table.node(("leaf", i), i not in variable), 1)
    return table, [place[e.index] for e in outputs]


def _rebuilt(table: Table, roots: Sequence[Term], rule: Rule) -> tuple[Table, list[Term]]:
    """A new table of what the roots read, each sum and product made anew by `rule(old, new, node, places)`."""
    new = Table()
    place: dict[int, Term] = {}
    for i in table.live([k for k, _ in roots]):
        kind, *rest = table.nodes[i]
        if kind == "leaf":
            place[i] = (new.node(table.nodes[i], table.constant[i]), 1)
        elif kind in ("cos", "sin"):
            k, s = place[rest[0]]
            place[i] = (new.node((kind, k), table.constant[i]), s if kind == "sin" else 1)
        else:
            place[i] = rule(table, new, i, place)
    return new, [(place[k][0], s * place[k][1]) for k, s in roots]


def _flattened(table: Table, roots: list[Term]) -> tuple[Table, list[Term]]:
    """Sums of single-use sums and products of single-use products as one."""
    uses = table.uses([k for k, _ in roots])

    def rule(old: Table, new: Table, i: int, place: dict[int, Term]) -> Term:
        kind, parts = old.nodes[i]
        if kind == "sum":
            terms: list[Term] = []
            for k, s in parts:
                at, sign = place[k]
                if uses[k] == 1 and new.nodes[at][0] == "sum" and not new.constant[at]:
                    terms += [(m, s * sign * t) for m, t in new.nodes[at][1]]
                else:
                    terms.append((at, s * sign))
            return new.total(terms)
        factors: list[int] = []
        sign = 1
        for k in parts:
            at, s = place[k]
            sign *= s
            single = uses[k] == 1 and new.nodes[at][0] == "product" and not new.constant[at]
            factors += new.nodes[at][1] if single else [at]
        return new.product(factors), sign

    return _rebuilt(table, roots, rule)


def _factored(table: Table, roots: list[Term]) -> tuple[Table, list[Term]]:
    """a·b + a·c as a·(b + c), where nothing else reads the products."""
    uses = table.uses([k for k, _ in roots])

    def rule(old: Table, new: Table, i: int, place: dict[int, Term]) -> Term:
        kind, parts = old.nodes[i]
        if kind == "product":
            sign = 1
            for k in parts:
                sign *= place[k][1]
            return new.product(place[k][0] for k in parts), sign
        terms: list[tuple[list[int] | None, Term]] = []
        for k, s in parts:
            at, sign = place[k]
            single = uses[k] == 1 and new.nodes[at][0] == "product" and not new.constant[at]
            terms.append((list(new.nodes[at][1]) if single else None, (at, s * sign)))
        while True:
            frequency = Counter(f for factors, _ in terms if factors for f in set(factors))
            best = max(frequency, key=lambda f: (frequency[f], not new.constant[f], -f), default=None)
            if best is None or frequency[best] < 2:
                return new.total(term for _, term in terms)
            inner: list[Term] = []
            rest: list[tuple[list[int] | None, Term]] = []
            for factors, (at, sign) in terms:
                if factors and best in factors:
                    factors.remove(best)
                    inner.append((new.product(factors), sign))
                else:
                    rest.append((factors, (at, sign)))
            inside, sign = new.total(inner)
            terms = [*rest, (None, (new.product([best, inside]), sign))]

    return _rebuilt(table, roots, rule)


def _shared(table: Table, roots: list[Term]) -> tuple[Table, list[Term]]:
    """Pairs of terms, and of factors, that occur more than once, as nodes of their own."""
    live = table.live([k for k, _ in roots])
    sums = {i: list(table.nodes[i][1]) for i in live if table.nodes[i][0] == "sum" and not table.constant[i]}
    products = {i: list(table.nodes[i][1]) for i in live if table.nodes[i][0] == "product" and not table.constant[i]}

    def free(a: int, b: int) -> bool:
        return table.constant[a] and table.constant[b]

    while True:
        pairs: Counter[tuple] = Counter()
        for terms in sums.values():
            found = {
                (a, b, s * t)
                for (a, s), (b, t) in combinations(sorted(terms), 2)
                if not (table.constant[a] and table.constant[b])
            }
            pairs.update(found)
        for factors in products.values():
            pairs.update(
                {(a, b) for a, b in combinations(sorted(factors), 2) if not (table.constant[a] and table.constant[b])}
            )
        best = max(pairs, key=lambda pair: (pairs[pair], [-x for x in pair]), default=None)
        if best is None or pairs[best] < 2:
            break
        if len(best) == 3:
            a, b, relative = best
            made, _ = table.total([(a, 1), (b, relative)])
            for i, terms in sums.items():
                for sign in (1, -1):
                    twice = a != b or relative < 0 or terms.count((a, sign)) > 1
                    if i != made and (a, sign) in terms and (b, sign * relative) in terms and twice:
                        terms.remove((a, sign))
                        terms.remove((b, sign * relative))
                        terms.append((made, sign))
                        break
            sums.setdefault(made, [(a, 1), (b, relative)])
        else:
            made = table.product(best)
            for i, factors in products.items():
                if i != made and all(k in factors for k in best) and (best[0] != best[1] or factors.count(best[0]) > 1):
                    for k in best:
                        factors.remove(k)
                    factors.append(made)
            products.setdefault(made, list(best))
    # Reading order may have changed: nodes are put in again from the leaves upwards.
    new = Table()
    place: dict[int, Term] = {}

    def put(i: int) -> Term:
        if i in place:
            return place[i]
        kind, *rest = table.nodes[i]
        if i in sums or kind == "sum":
            found = new.total([(put(k)[0], s * put(k)[1]) for k, s in sums.get(i, rest[0])])
        elif i in products or kind == "product":
            parts = [put(k) for k in products.get(i, rest[0])]
            sign = 1
            for _, s in parts:
                sign *= s
            found = (new.product(k for k, _ in parts), sign)
        elif kind == "leaf":
            found = (new.node(table.nodes[i], table.constant[i]), 1)
        else:
            k, s = put(rest[0])
            found = (new.node((kind, k), table.constant[i]), s if kind == "sin" else 1)
        place[i] = found
        return found

    return new, [(put(k)[0], s * put(k)[1]) for k, s in roots]


def _expressions(old: Graph, table: Table, roots: Sequence[Term]) -> list[Expression]:
    """The table as binary expressions of a new graph, constants of a sum or product together first."""
    graph = Graph()
    place: dict[int, Expression] = {}
    constants: dict[int, Expression] = {}

    def constant(i: int) -> Expression:
        """A leaf, which may be a whole expression of constants."""
        if i not in constants:
            kind, *rest = old.nodes[i]
            if kind in ("constant", "symbol"):
                constants[i] = graph.node(kind, *rest)
            else:
                constants[i] = OPERATIONS[kind](*(constant(k) for k in rest))
        return constants[i]

    for i in table.live([k for k, _ in roots]):
        kind, *rest = table.nodes[i]
        if kind == "leaf":
            place[i] = constant(rest[0])
        elif kind == "sum":
            # Constants first, and a plus before every minus: turning the sign of a difference would cost another one.
            constants_first = sorted(rest[0], key=lambda term: (term[1] < 0, not table.constant[term[0]]))
            fixed = _sum((place[k], s) for k, s in rest[0] if table.constant[k])
            moving = [(place[k], s) for k, s in constants_first if not table.constant[k]]
            place[i] = _sum([*moving[:1], (fixed, 1), *moving[1:]])  # type: ignore[assignment]
        elif kind == "product":
            product: Scalar = 1
            for k in sorted(rest[0], key=lambda k: not table.constant[k]):
                product = product * place[k]
            place[i] = product  # type: ignore[assignment]
        else:
            place[i] = OPERATIONS[kind](place[rest[0]])
    return [_signed(place[k], s) for k, s in roots]


def _sum(terms: Iterable[tuple[Scalar, int]]) -> Scalar:
    total: Scalar = 0
    for term, sign in terms:
        total = total + term if sign > 0 else total - term
    return total


def _signed(x: Expression, sign: int) -> Expression:
    """The expression or its opposite, without making a second difference of one."""
    if sign > 0:
        return x
    return -x if x.value is not None else x.graph.node("neg", x.index)
