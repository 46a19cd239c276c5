"""Operations of a printed Python function, counted from its text: an oracle that shares nothing with the counter."""

from __future__ import annotations

import ast

from identify.symbolic.operations import Operations


def recount(source: str) -> Operations:
    """Products and sums that the function computes at each call from its arguments; arithmetic among module constants
    is free, as are changes of sign and cosines.
    """
    tree = ast.parse(source)
    (function,) = (node for node in tree.body if isinstance(node, ast.FunctionDef))
    varying = {argument.arg for argument in function.args.args}
    total = [0, 0]

    def moves(node: ast.expr) -> bool:
        return any(isinstance(n, ast.Name) and n.id in varying for n in ast.walk(node))

    def parts(node: ast.expr, kinds: tuple) -> list[ast.expr]:
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return parts(node.operand, kinds)
        if isinstance(node, ast.BinOp) and isinstance(node.op, kinds):
            return parts(node.left, kinds) + parts(node.right, kinds)
        return [node]

    def visit(node: ast.expr) -> None:
        if isinstance(node, ast.UnaryOp):
            visit(node.operand)
        elif isinstance(node, ast.Call):
            for argument in node.args:
                visit(argument)
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            assert isinstance(node.right, ast.Constant)
            assert node.right.value == 2
            total[0] += moves(node.left)
            visit(node.left)
        elif isinstance(node, ast.BinOp):
            is_sum = isinstance(node.op, (ast.Add, ast.Sub))
            found = parts(node, (ast.Add, ast.Sub) if is_sum else (ast.Mult, ast.Div))
            moving = sum(moves(part) for part in found)
            total[is_sum] += moving + (moving < len(found)) - 1 if moving else 0
            for part in found:
                visit(part)

    for line in function.body:
        if isinstance(line, ast.Assign):
            target = line.targets[0]
            if isinstance(target, ast.Tuple):
                varying |= {name.id for name in target.elts if isinstance(name, ast.Name)}
            elif isinstance(target, ast.Name) and moves(line.value):
                varying.add(target.id)
                visit(line.value)
    return Operations(total[0], total[1], 0)
