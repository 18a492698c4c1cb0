"""A small network that numpy evaluates: layers of weights, with a normaliser in front.

    network = Perceptron.read(json.loads(text))
    action = network(observation)

Sums go through the inputs in their order. So the result has the same bits on any processor, and in a batch of any size,
which a matrix product has not.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fg_mujoco.compiled.kernels import kernel
from fg_mujoco.errors import SettingsError, accepted_names
from fg_mujoco.messages import shown

Values = NDArray[np.float32]

_FLOAT = np.dtype("<f4")  # of weights in text, on any machine

ACTIVATIONS: Mapping[str, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "none": lambda x: x,
    "relu": lambda x: np.maximum(x, 0.0),
    "tanh": np.tanh,
    "elu": lambda x: np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0))),
    "silu": lambda x: x / (1.0 + np.exp(-x)),
    "sigmoid": lambda x: 1.0 / (1.0 + np.exp(-x)),
}
"""Of float64, whose results are rounded to float32: the last bit of an exponential differs between processors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """A layer: weights times inputs, plus bias, through an activation.

    Raises:
      SettingsError: shapes that do not fit, numbers that are not finite, or an unknown activation.
    """

    weights: Values  # (outputs, inputs)
    bias: Values  # (outputs,)
    activation: str = "none"  # one of ACTIVATIONS

    def __post_init__(self) -> None:
        for name in ("weights", "bias"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), np.float32))
        shape = self.weights.shape
        if self.weights.ndim != 2 or 0 in shape or self.bias.shape != shape[:1]:
            said = f"weights of shape {shape} with a bias of shape {self.bias.shape}"
            raise SettingsError(f"a layer has {said}; accepted: (outputs, inputs) and (outputs,)")
        if not (np.isfinite(self.weights).all() and np.isfinite(self.bias).all()):
            raise SettingsError("a layer has weights that are not finite; accepted: finite numbers")
        if self.activation not in ACTIVATIONS:
            said = f"the activation of a layer is {shown(self.activation)}"
            raise SettingsError(f"{said}; {accepted_names(self.activation, ACTIVATIONS)}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Normaliser:
    """Inputs less their mean, divided by their standard deviation, held within -clip to clip.

    Raises:
      SettingsError: shapes that differ, a standard deviation that is not positive, or numbers that are not finite.
    """

    mean: Values  # (inputs,)
    std: Values  # (inputs,)
    clip: float = 10.0

    def __post_init__(self) -> None:
        for name in ("mean", "std"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), np.float32))
        right = self.mean.ndim == 1 and self.mean.shape == self.std.shape and self.clip > 0.0
        if not (right and np.isfinite(self.mean).all() and np.isfinite(self.std).all() and (self.std > 0.0).all()):
            raise SettingsError(
                f"a normaliser has a mean of shape {self.mean.shape} and a standard deviation of {self.std.shape}; "
                "accepted: finite numbers of one shape (inputs,), the second positive, and a positive clip"
            )

    def __call__(self, values: Values) -> Values:
        """Return the normalised values. Shape (inputs,)."""
        found: Values = np.clip((values - self.mean) / self.std, np.float32(-self.clip), np.float32(self.clip))
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class Perceptron:
    """Layers one after the other, with an optional normaliser of the inputs.

    Raises:
      SettingsError: no layer, or layers that do not fit each other.
    """

    layers: tuple[Layer, ...]
    normaliser: Normaliser | None = None
    estimator: Perceptron | None = None  # of the normalised inputs; its outputs are inputs besides, after these

    def __post_init__(self) -> None:
        if not self.layers:
            raise SettingsError("a network has no layer; accepted: one or more")
        own, more = self.estimator, 0 if self.estimator is None else self.estimator.outputs
        widths = [self.inputs + more, *(len(layer.bias) for layer in self.layers)]
        taken = [layer.weights.shape[1] for layer in self.layers]
        if taken != widths[:-1] or (self.normaliser is not None and len(self.normaliser.mean) != self.inputs):
            raise SettingsError(f"the layers of a network give {widths[1:]} and take {taken}; accepted: as many each")
        if own is not None and own.inputs != self.inputs:
            said = f"the estimator of a network takes {own.inputs} numbers, the network {self.inputs} and {more} of it"
            raise SettingsError(f"{said}; accepted: the same ones")
        columns = [np.ascontiguousarray(layer.weights.T) for layer in self.layers]  # whose sum down goes in order
        object.__setattr__(self, "_columns", columns)

    @property
    def inputs(self) -> int:
        """How many numbers it takes."""
        return int(self.layers[0].weights.shape[1]) - (0 if self.estimator is None else self.estimator.outputs)

    @property
    def outputs(self) -> int:
        """How many numbers it returns."""
        return len(self.layers[-1].bias)

    def __call__(self, values: ArrayLike) -> Values:
        """Return the outputs (outputs,) for inputs (inputs,)."""
        found: Values = self.of_each(np.asarray(values, np.float32)[np.newaxis])[0]
        return found

    def of_each(self, values: Values) -> Values:
        """Return the outputs (n, outputs) for inputs (n, inputs): in each row the bits of a call with that row."""
        found = values if self.normaliser is None else self.normaliser(values)
        if self.estimator is not None:
            found = np.concatenate((found, self.estimator.of_each(found)), axis=1)
        with np.errstate(over="ignore"):
            for layer, columns in zip(self.layers, self._columns, strict=True):  # type: ignore[attr-defined]
                sums = np.empty((len(found), len(layer.bias)), np.float32)
                add_up(np.ascontiguousarray(found), columns, layer.bias, sums)
                found = sums
                if layer.activation != "none":
                    found = ACTIVATIONS[layer.activation](sums.astype(np.float64)).astype(np.float32)
        return found

    def described(self) -> dict[str, Any]:
        """Return the network as JSON takes it; weights are the bytes of float32 numbers, in base64."""
        layers = [
            {"activation": each.activation, "weights": _text(each.weights), "bias": _text(each.bias)}
            for each in self.layers
        ]
        own = self.normaliser
        normaliser = own and {"mean": _text(own.mean), "std": _text(own.std), "clip": own.clip}
        estimator = {} if self.estimator is None else {"estimator": self.estimator.described()}
        return {"layers": layers, "normaliser": normaliser} | estimator

    @classmethod
    def read(cls, described: Mapping[str, Any]) -> Perceptron:
        """Return the network that `described()` has described.

        Raises:
          SettingsError: it is no such description, or as the class.
        """
        try:
            layers = tuple(
                Layer(weights=_array(each["weights"]), bias=_array(each["bias"]), activation=each["activation"])
                for each in described["layers"]
            )
            own = described.get("normaliser")
            normaliser = None
            if own is not None:
                normaliser = Normaliser(mean=_array(own["mean"]), std=_array(own["std"]), clip=float(own["clip"]))
            inner = described.get("estimator")
            estimator = None if inner is None else cls.read(inner)
        except (KeyError, TypeError, AttributeError, ValueError, OverflowError, binascii.Error) as error:
            if isinstance(error, SettingsError):
                raise
            said = f"a network is damaged ({type(error).__name__}: {error})"[:300]
            raise SettingsError(f"{said}; accepted: layers and a normaliser, as saved") from error
        return cls(layers=layers, normaliser=normaliser, estimator=estimator)


@kernel
def add_up(values: Values, columns: Values, bias: Values, sums: Values) -> None:
    """Write values (n, inputs) times columns (inputs, outputs), plus bias, to `sums` (n, outputs).

    Products are added in the order of the inputs, and the bias last, as a Perceptron adds them.
    """
    for row in range(len(values)):
        for output in range(len(bias)):
            sums[row, output] = values[row, 0] * columns[0, output]
        for k in range(1, len(columns)):
            value = values[row, k]
            for output in range(len(bias)):
                sums[row, output] += value * columns[k, output]
        for output in range(len(bias)):
            sums[row, output] += bias[output]


def _text(values: Values) -> dict[str, Any]:
    return {
        "shape": list(values.shape),
        "float32": base64.b64encode(np.ascontiguousarray(values, _FLOAT).tobytes()).decode("ascii"),
    }


def _array(described: Mapping[str, Any]) -> Values:
    """Return the array of `_text`.

    Raises:
      ValueError: as many bytes as the shape does not have.
    """
    shape: Sequence[int] = [int(size) for size in described["shape"]]
    content = base64.b64decode(described["float32"], validate=True)
    if min(shape, default=0) < 1 or len(content) != _FLOAT.itemsize * math.prod(shape):
        raise ValueError(f"{len(content)} bytes for the shape {shape}")
    return np.frombuffer(content, _FLOAT).astype(np.float32).reshape(shape)
