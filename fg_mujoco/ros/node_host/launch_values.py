"""Works out the values in a launch file of ROS 2 in Python without executing it.

A launch file is a program. Here its statements are followed one by one: assignments, lists and dictionaries, strings,
`if`, `for`, functions of its own, paths, and YAML files that it reads. What else it does has no value: it is `Unknown`,
with its line, and is reported only where a node depends on it. Calls of `launch` and `launch_ros` become `Made`, whose
meaning `launch_files` knows.
"""

from __future__ import annotations

import ast
import operator
import os
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from ...course.maps.map_server import plain_yaml
from ...errors import ControllerError

_MOST_STEPS = 100_000  # statements and expressions that are followed in one launch file
_LARGEST = 1_000_000  # number, and length of a text or list, that is worked out
_WIDE = re.compile(r"\d{4}")  # in the format of a number or a text
_BUILTINS: dict[str, Callable[..., Any]] = {
    "str": str, "int": int, "float": float, "bool": bool, "len": len, "list": list, "dict": dict, "tuple": tuple,
    "set": set, "range": lambda *values: list(range(*values))[:1000], "zip": lambda *values: list(zip(*values)),  # noqa: B905
    "enumerate": lambda *values: list(enumerate(*values)), "sorted": sorted, "min": min, "max": max, "any": any,
    "all": all, "abs": abs, "round": round, "print": lambda *_, **__: None, "sum": sum,
}  # fmt: skip
_PATHS: dict[str, Callable[..., Any]] = {
    name: getattr(os.path, name)
    for name in ("join", "dirname", "abspath", "basename", "expanduser", "exists", "isfile", "isdir", "realpath",
                 "normpath", "splitext", "split", "isabs")
}  # fmt: skip
_OPERATORS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Is: operator.is_,
    ast.IsNot: operator.is_not, ast.In: lambda a, b: a in b, ast.NotIn: lambda a, b: a not in b,
}  # fmt: skip
_METHODS: dict[type, tuple[str, ...]] = {
    str: ("format", "join", "lower", "upper", "strip", "split", "replace", "startswith", "endswith", "rstrip"),
    list: ("append", "extend", "insert", "index", "count", "copy", "pop", "remove"),
    dict: ("get", "update", "items", "keys", "values", "copy", "setdefault", "pop"),
    tuple: ("index", "count"), set: ("add", "update"),
}  # fmt: skip


@dataclass(frozen=True)
class Unknown:
    """A value that is not worked out, with the text and the line that it comes from."""

    text: str
    line: int
    file: Path
    why: str = "is not understood"


@dataclass(eq=False)
class Made:
    """An object of `launch` or `launch_ros`: an action, a substitution or a condition."""

    kind: str  # name of its class
    values: list[Any]
    named: dict[str, Any]
    line: int
    file: Path


@dataclass(frozen=True)
class _Module:
    """A name that a launch file imports, with its dots."""

    name: str


@dataclass(eq=False)
class _Function:
    """A function of the launch file's own."""

    body: list[ast.stmt]
    arguments: ast.arguments
    names: dict[str, Any]


class _Returned(Exception):  # noqa: N818
    def __init__(self, value: Any) -> None:
        self.value = value


class _Left(Exception):  # noqa: N818
    """`break` or `continue`."""


@dataclass
class LaunchProgram:
    """The text of one launch file, followed.

    Args:
      path: of the file.
      tree: its text.
      share: returns the share directory of a package, by its name; None where the package is not here.
      perform: returns the text of a substitution.
    """

    path: Path
    tree: ast.Module
    share: Callable[[str], Path | None]
    perform: Callable[[Any], str]
    steps: int = 0
    names: dict[str, Any] = field(default_factory=dict)

    def description(self) -> Any:
        """Evaluate `generate_launch_description`.

        Raises:
          ControllerError: there is no such function; or an `if` or a loop depends on what has no value here.
        """
        self.names["__file__"] = str(self.path.resolve())
        try:
            self._block(self.tree.body, self.names)
            found = self.names.get("generate_launch_description")
            if not isinstance(found, _Function):
                raise ControllerError(f"{self.path} has no function generate_launch_description; accepted: one")
            return self.call(found, [], {})
        except (_Returned, _Left, RecursionError) as error:
            raise ControllerError(f"{self.path} cannot be followed: {type(error).__name__}") from error

    def call(self, function: Any, values: list[Any], named: Mapping[str, Any]) -> Any:
        """Call a function of the launch file's own."""
        if not isinstance(function, _Function):
            return function
        arguments = [each.arg for each in (*function.arguments.posonlyargs, *function.arguments.args)]
        for each, value in zip(function.arguments.kwonlyargs, function.arguments.kw_defaults, strict=True):
            named = {each.arg: None if value is None else self._value(value, function.names), **named}
        defaults = function.arguments.defaults
        names = dict(function.names)
        for name, default in zip(arguments[len(arguments) - len(defaults) :], defaults, strict=True):
            names[name] = self._value(default, function.names)
        names.update(zip(arguments, values, strict=False))
        if function.arguments.vararg is not None:
            names[function.arguments.vararg.arg] = values[len(arguments) :]
        if function.arguments.kwarg is not None:
            known = {*arguments, *(each.arg for each in function.arguments.kwonlyargs)}
            names[function.arguments.kwarg.arg] = {name: value for name, value in named.items() if name not in known}
            named = {name: value for name, value in named.items() if name in known}
        names.update(named)
        try:
            self._block(function.body, names)
        except _Returned as returned:
            return returned.value
        return None

    # Statements

    def _block(self, body: list[ast.stmt], names: dict[str, Any]) -> None:
        for statement in body:
            self._step(statement)
            follow = getattr(self, f"_do_{type(statement).__name__.lower()}", None)
            if follow is not None:
                follow(statement, names)

    def _do_import(self, statement: ast.Import, names: dict[str, Any]) -> None:
        for each in statement.names:
            top = each.name if each.asname else each.name.partition(".")[0]
            names[each.asname or top] = _Module(top)

    def _do_importfrom(self, statement: ast.ImportFrom, names: dict[str, Any]) -> None:
        for each in statement.names:
            names[each.asname or each.name] = _Module(f"{statement.module}.{each.name}")

    def _do_functiondef(self, statement: ast.FunctionDef, names: dict[str, Any]) -> None:
        names[statement.name] = _Function(statement.body, statement.args, names)

    def _do_expr(self, statement: ast.Expr, names: dict[str, Any]) -> None:
        self._value(statement.value, names)

    def _do_return(self, statement: ast.Return, names: dict[str, Any]) -> None:
        raise _Returned(None if statement.value is None else self._value(statement.value, names))

    def _do_assign(self, statement: ast.Assign, names: dict[str, Any]) -> None:
        value = self._value(statement.value, names)
        for target in statement.targets:
            self._bind(target, value, names)

    def _do_annassign(self, statement: ast.AnnAssign, names: dict[str, Any]) -> None:
        if statement.value is not None:
            self._bind(statement.target, self._value(statement.value, names), names)

    def _do_augassign(self, statement: ast.AugAssign, names: dict[str, Any]) -> None:
        read = ast.copy_location(ast.parse(ast.unparse(statement.target), mode="eval").body, statement.target)
        before, value = self._value(read, names), self._value(statement.value, names)
        self._bind(statement.target, self._operate(statement.op, before, value, statement), names)

    def _do_if(self, statement: ast.If, names: dict[str, Any]) -> None:
        self._block(statement.body if self._known(statement.test, names) else statement.orelse, names)

    def _do_for(self, statement: ast.For, names: dict[str, Any]) -> None:
        for each in self._several(statement.iter, names):
            self._bind(statement.target, each, names)
            try:
                self._block(statement.body, names)
            except _Left as left:
                if left.args[0] == "break":
                    return
        self._block(statement.orelse, names)

    def _do_break(self, statement: ast.Break, names: dict[str, Any]) -> None:
        raise _Left("break")

    def _do_continue(self, statement: ast.Continue, names: dict[str, Any]) -> None:
        raise _Left("continue")

    def _do_with(self, statement: ast.With, names: dict[str, Any]) -> None:
        for each in statement.items:
            if each.optional_vars is not None:
                self._bind(each.optional_vars, self._value(each.context_expr, names), names)
        self._block(statement.body, names)

    def _do_try(self, statement: ast.Try, names: dict[str, Any]) -> None:
        self._block([*statement.body, *statement.orelse, *statement.finalbody], names)

    def _do_raise(self, statement: ast.Raise, names: dict[str, Any]) -> None:
        self._refuse(Unknown(ast.unparse(statement), statement.lineno, self.path, "is reached"))

    def _do_while(self, statement: ast.While, names: dict[str, Any]) -> None:
        self._refuse(Unknown(f"while {ast.unparse(statement.test)}", statement.lineno, self.path))

    def _bind(self, target: ast.expr, value: Any, names: dict[str, Any]) -> None:
        if isinstance(target, ast.Name):
            names[target.id] = value
        elif isinstance(target, (ast.Tuple, ast.List)):
            many = list(value) if isinstance(value, (list, tuple)) and len(value) == len(target.elts) else None
            for i, each in enumerate(target.elts):
                self._bind(each, self._unknown(target) if many is None else many[i], names)
        elif isinstance(target, ast.Subscript):
            inside, key = self._value(target.value, names), self._value(target.slice, names)
            if isinstance(inside, (dict, list)):
                with suppress(TypeError, IndexError):
                    inside[key] = value

    # Expressions

    def _value(self, node: ast.AST, names: dict[str, Any]) -> Any:
        self._step(node)
        work = getattr(self, f"_of_{type(node).__name__.lower()}", None)
        return self._unknown(node) if work is None else work(node, names)

    def _known(self, node: ast.expr, names: dict[str, Any]) -> Any:
        """Return a value on which it depends which statements come next."""
        value = self._value(node, names)
        if isinstance(value, (Unknown, Made, _Module, _Function)):
            self._refuse(value if isinstance(value, Unknown) else self._unknown(node))
        return value

    def _several(self, node: ast.expr, names: dict[str, Any]) -> list[Any]:
        """Return the values that a loop goes over."""
        value = self._known(node, names)
        if not isinstance(value, (list, tuple, dict, str, set)):
            self._refuse(self._unknown(node))
        return list(value)

    def _of_constant(self, node: ast.Constant, names: dict[str, Any]) -> Any:
        return node.value

    def _of_name(self, node: ast.Name, names: dict[str, Any]) -> Any:
        if node.id in names:
            return names[node.id]
        if node.id in self.names:
            return self.names[node.id]
        return _Module(node.id) if node.id in _BUILTINS or node.id == "open" else self._unknown(node)

    def _of_list(self, node: ast.List, names: dict[str, Any]) -> Any:
        found: list[Any] = []
        for each in node.elts:
            if isinstance(each, ast.Starred):
                inner = self._value(each.value, names)
                found += list(inner) if isinstance(inner, (list, tuple)) else [inner]
            else:
                found.append(self._value(each, names))
        return found

    def _of_tuple(self, node: ast.Tuple, names: dict[str, Any]) -> Any:
        return tuple(self._of_list(ast.List(node.elts, ast.Load()), names))

    def _of_set(self, node: ast.Set, names: dict[str, Any]) -> Any:
        return self._of_list(ast.List(node.elts, ast.Load()), names)

    def _of_dict(self, node: ast.Dict, names: dict[str, Any]) -> Any:
        found: dict[Any, Any] = {}
        for key, value in zip(node.keys, node.values, strict=True):
            worked = self._value(value, names)
            if key is None:
                found.update(worked if isinstance(worked, dict) else {})
            else:
                name = self._value(key, names)
                found[self.perform(name) if isinstance(name, Made) else name if _plain(name) else str(name)] = worked
        return found

    def _of_joinedstr(self, node: ast.JoinedStr, names: dict[str, Any]) -> Any:
        parts = [self._value(each, names) for each in node.values]
        bad = next((each for each in parts if isinstance(each, Unknown)), None)
        return bad if bad is not None else "".join(map(str, parts))

    def _of_formattedvalue(self, node: ast.FormattedValue, names: dict[str, Any]) -> Any:
        value = self._value(node.value, names)
        if isinstance(value, Unknown):
            return value
        if not _plain(value) and not isinstance(value, Path):
            return self._unknown(node)
        form = "" if node.format_spec is None else self._value(node.format_spec, names)
        if _WIDE.search(str(form)):
            return self._unknown(node)
        return self._tried(node, lambda: format(value, form))

    def _of_binop(self, node: ast.BinOp, names: dict[str, Any]) -> Any:
        return self._operate(node.op, self._value(node.left, names), self._value(node.right, names), node)

    def _of_boolop(self, node: ast.BoolOp, names: dict[str, Any]) -> Any:
        value: Any = None
        for each in node.values:
            value = self._value(each, names)
            if isinstance(value, Unknown) or bool(value) is isinstance(node.op, ast.Or):
                return value
        return value

    def _of_unaryop(self, node: ast.UnaryOp, names: dict[str, Any]) -> Any:
        value = self._value(node.operand, names)
        if isinstance(value, Unknown):
            return value
        known: dict[type, Callable[[Any], Any]] = {
            ast.Not: operator.not_, ast.USub: operator.neg, ast.UAdd: operator.pos,
        }  # fmt: skip
        return self._tried(node, lambda: known[type(node.op)](value))

    def _of_compare(self, node: ast.Compare, names: dict[str, Any]) -> Any:
        left = self._value(node.left, names)
        for sign, each in zip(node.ops, node.comparators, strict=True):
            right = self._value(each, names)
            found = self._operate(sign, left, right, node)
            if isinstance(found, Unknown) or not found:
                return found
            left = right
        return True

    def _of_ifexp(self, node: ast.IfExp, names: dict[str, Any]) -> Any:
        return self._value(node.body if self._known(node.test, names) else node.orelse, names)

    def _of_subscript(self, node: ast.Subscript, names: dict[str, Any]) -> Any:
        inside, key = self._value(node.value, names), self._value(node.slice, names)
        if isinstance(inside, _Module) and inside.name == "os.environ":
            return os.environ.get(str(key), self._unknown(node))
        bad = next((each for each in (inside, key) if isinstance(each, Unknown)), None)
        return bad if bad is not None else self._tried(node, lambda: inside[key])

    def _of_slice(self, node: ast.Slice, names: dict[str, Any]) -> Any:
        return slice(
            *(None if each is None else self._value(each, names) for each in (node.lower, node.upper, node.step))
        )

    def _of_listcomp(self, node: ast.ListComp, names: dict[str, Any]) -> Any:
        found: list[Any] = []
        self._each(node.generators, dict(names), lambda inner: found.append(self._value(node.elt, inner)))
        return found

    _of_generatorexp = _of_setcomp = _of_listcomp

    def _of_dictcomp(self, node: ast.DictComp, names: dict[str, Any]) -> Any:
        found: dict[Any, Any] = {}

        def add(inner: dict[str, Any]) -> None:
            found[str(self._value(node.key, inner))] = self._value(node.value, inner)

        self._each(node.generators, dict(names), add)
        return found

    def _each(
        self, loops: list[ast.comprehension], names: dict[str, Any], act: Callable[[dict[str, Any]], Any]
    ) -> None:
        if not loops:
            act(names)
            return
        for each in self._several(loops[0].iter, names):
            self._bind(loops[0].target, each, names)
            if all(self._known(test, names) for test in loops[0].ifs):
                self._each(loops[1:], names, act)

    def _of_lambda(self, node: ast.Lambda, names: dict[str, Any]) -> Any:
        body: list[ast.stmt] = [ast.copy_location(ast.Return(node.body), node)]
        return _Function(body, node.args, names)

    def _of_attribute(self, node: ast.Attribute, names: dict[str, Any]) -> Any:
        inside = self._value(node.value, names)
        if isinstance(inside, _Module):
            return _Module(f"{inside.name}.{node.attr}")
        if isinstance(inside, Path) and node.attr in ("parent", "name", "stem", "parents", "suffix"):
            found = getattr(inside, node.attr)
            return list(found) if node.attr == "parents" else found
        if isinstance(inside, Made) and inside.kind == "context" and node.attr == "launch_configurations":
            return inside.named
        return inside if isinstance(inside, Unknown) else self._unknown(node)

    def _of_call(self, node: ast.Call, names: dict[str, Any]) -> Any:
        values = self._of_list(ast.List(node.args, ast.Load()), names)
        named: dict[str, Any] = {}
        for each in node.keywords:
            value = self._value(each.value, names)
            if each.arg is None and not isinstance(value, dict):
                return value if isinstance(value, Unknown) else self._unknown(node)
            named.update(value if each.arg is None else {each.arg: value})
        if isinstance(node.func, ast.Attribute):
            inside = self._value(node.func.value, names)
            if not isinstance(inside, _Module):
                return self._method(inside, node.func.attr, values, named, node)
        function = self._value(node.func, names)
        if isinstance(function, _Function):
            return self.call(function, values, named)
        return self._imported(function.name, values, named, node) if isinstance(function, _Module) else function

    def _method(self, inside: Any, name: str, values: list[Any], named: dict[str, Any], node: ast.Call) -> Any:
        if isinstance(inside, Made):
            if name == "perform":
                return self.perform(inside)
            if name == "add_action":
                inside.values.append([*values, *named.values()][0])
                return None
            return self._unknown(node)
        if isinstance(inside, Path):
            known = ("joinpath", "resolve", "exists", "is_file", "is_dir", "as_posix", "absolute", "with_suffix")
            if name in known and all(_plain(each) or isinstance(each, Path) for each in values):
                return self._tried(node, lambda: getattr(inside, name)(*values))
        if name in _METHODS.get(type(inside), ()):
            if isinstance(inside, str) and not all(_plain(each) or isinstance(each, list) for each in values):
                return self._unknown(node)
            if len(inside) > _LARGEST or (name == "format" and _WIDE.search(inside)):
                return self._unknown(node)
            found = self._tried(node, lambda: getattr(inside, name)(*values, **named))
            return list(found) if name in ("items", "keys", "values") and not isinstance(found, Unknown) else found
        return inside if isinstance(inside, Unknown) else self._unknown(node)

    def _imported(self, name: str, values: list[Any], named: dict[str, Any], node: ast.Call) -> Any:
        """Return the result of a call of something that is imported or built in."""
        last = name.rpartition(".")[2]
        if name.startswith(("launch.", "launch_ros.", "nav2_common.")):
            return Made(last, values, named, node.lineno, self.path)
        bad = next((each for each in (*values, *named.values()) if isinstance(each, Unknown)), None)
        if bad is not None:
            return bad
        if last in ("get_package_share_directory", "get_package_share_path", "get_package_prefix"):
            package = [*values, *named.values()][0] if values or named else ""
            found = self.share(str(package)) if _plain(package) else None
            if found is None:
                return Unknown(
                    ast.unparse(node), node.lineno, self.path, f"names package {package!r}, which is not here"
                )
            return found if last == "get_package_share_path" else str(found)
        if name.startswith("os.path.") and last in _PATHS:
            texts = [self.perform(each) if isinstance(each, Made) else each for each in values]
            return self._tried(node, lambda: _PATHS[last](*texts))
        if name in ("os.getcwd", "pathlib.Path.cwd", "pathlib.Path.home"):
            return {"getcwd": os.getcwd, "cwd": Path.cwd, "home": Path.home}[last]()
        if name in ("os.environ.get", "os.getenv"):
            return self._tried(node, lambda: os.environ.get(*values))
        if name in ("pathlib.Path", "open"):
            return self._tried(node, lambda: Path(*values[: 1 if name == "open" else None]))
        if name in ("yaml.safe_load", "yaml.load", "yaml.full_load") and isinstance(
            values[0] if values else None, Path
        ):
            return self._read(values[0], node)
        if name in _BUILTINS and not any(isinstance(each, (Made, _Function, _Module)) for each in values):
            return self._tried(node, lambda: _BUILTINS[name](*values, **named))
        return self._unknown(node)

    def _read(self, path: Path, node: ast.Call) -> Any:
        try:
            if not path.is_file() or path.stat().st_size > _LARGEST:
                raise OSError("it is no file, or too large")
            return plain_yaml(path.read_bytes())
        except Exception as error:  # YAML's own, too
            said = " ".join(str(error).split())
            return Unknown(ast.unparse(node), node.lineno, self.path, f"reads {path}, which cannot be read: {said}")

    def _operate(self, sign: Any, left: Any, right: Any, node: Any) -> Any:
        bad = next((each for each in (left, right) if isinstance(each, Unknown)), None)
        if bad is not None:
            return bad
        if isinstance(sign, ast.Mult):
            for many, times in ((left, right), (right, left)):
                if hasattr(many, "__len__") and isinstance(times, int) and len(many) * times > _LARGEST:
                    return Unknown(ast.unparse(node), getattr(node, "lineno", 0), self.path, "is too large")
        if isinstance(sign, ast.Mod) and isinstance(left, str) and _WIDE.search(left):
            return self._unknown(node)
        if type(sign) not in _OPERATORS or any(isinstance(each, (Made, _Function, _Module)) for each in (left, right)):
            return self._unknown(node)
        return self._tried(node, lambda: _OPERATORS[type(sign)](left, right))

    def _tried(self, node: ast.AST, work: Callable[[], Any]) -> Any:
        try:
            found = work()
        except Exception as error:
            return Unknown(
                ast.unparse(node), getattr(node, "lineno", 0), self.path, f"fails: {type(error).__name__}: {error}"
            )
        if (isinstance(found, int) and abs(found) > _LARGEST) or (hasattr(found, "__len__") and len(found) > _LARGEST):
            return Unknown(ast.unparse(node), getattr(node, "lineno", 0), self.path, "is too large")
        return found

    def _unknown(self, node: Any) -> Unknown:
        return Unknown(ast.unparse(node), getattr(node, "lineno", 0), self.path)

    def _refuse(self, value: Unknown) -> NoReturn:
        raise ControllerError(refusal(value))

    def _step(self, node: ast.AST) -> None:
        self.steps += 1
        if self.steps > _MOST_STEPS:
            self._refuse(
                Unknown("the file", getattr(node, "lineno", 0), self.path, f"takes more than {_MOST_STEPS} steps")
            )


def refusal(value: Unknown) -> str:
    """Return the message for a value that a node depends on and that is not worked out."""
    text = value.text if len(value.text) <= 80 else value.text[:77] + "..."
    return (
        f"{' '.join(text.split())} {value.why} ({value.file}, line {value.line}); accepted: Python of constants, "
        "paths, YAML files and launch arguments, or a launch file of this package's own form: ros:launch.yaml"
    )


def expression(text: str) -> Any:
    """Return the value of an expression of constants, as PythonExpression has them.

    Raises:
      ValueError: it is none.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError) as error:
        raise ValueError(f"{text!r} is no expression") from error
    program = LaunchProgram(Path(), ast.Module([], []), lambda _: None, str)
    found = program._value(tree.body, {"true": True, "false": False})
    if isinstance(found, Unknown):
        raise ValueError(f"{text!r} {found.why}")
    return found


def _plain(value: Any) -> bool:
    return value is None or isinstance(value, (str, int, float, bool))
