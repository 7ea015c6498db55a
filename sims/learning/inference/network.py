"""Estimate (x, y, depth) with small neural networks: layers of weighted sums with an activation function between them.

    h_0 = features;  h_k = act(h_{k-1} W_k + b_k);  (x, y, depth) = mean + scale × (h_{n-1} W_n + b_n)

The activation `act` is the rectifier or the hyperbolic tangent. Several networks that differ in their random start form
an ensemble: their mean is the estimate. The raw deviation is 1 mm for every frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from design.arrays import FloatArray
from design.errors import InputError
from sims.learning.inference.feature_scaling import scaling_of_arrays
from sims.learning.inference.header import ModelHeader
from sims.learning.inference.sigma_table import sigma_table_of_arrays
from sims.learning.inference.touch_model import Arrays, taken
from sims.learning.inference.touch_svm import touch_svm_of_arrays
from sims.learning.inference.trusted_model import TrustedModel

ACTIVATIONS = ("relu", "tanh")


@dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """Layers of one network.

    Attributes
    ----------
    weights : weights of each layer, (inputs, outputs) each
    biases : biases of each layer, (outputs,) each
    activation : `relu` (rectifier) or `tanh`
    """

    weights: tuple[NDArray[np.float32], ...]
    biases: tuple[NDArray[np.float32], ...]
    activation: str

    def outputs(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Outputs (n, output) of the network for features (n, feature) [-]."""
        found = features
        for weights, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            found = found @ weights + bias
            found = np.maximum(found, 0.0) if self.activation == "relu" else np.tanh(found)
        return np.asarray(found @ self.weights[-1] + self.biases[-1])


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkModel(TrustedModel):
    """A touch classifier, and neural networks that estimate x, y, depth and their deviations.

    Attributes
    ----------
    networks : networks of the ensemble; `TrustedModel` has the attributes not listed here
    mean_mm, scale_mm : (3,) offset and scale of the networks' outputs [mm]
    """

    networks: tuple[Network, ...]
    mean_mm: FloatArray
    scale_mm: FloatArray

    def press_and_spread_mm(self, signals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean x, y, depth (n, 3) over the networks, and raw deviations (n, 3) of 1 mm throughout [mm]."""
        features = self.scaling.features(signals).astype(np.float32)
        said = np.mean([one.outputs(features) for one in self.networks], axis=0, dtype=np.float64)
        press_mm = np.asarray(self.mean_mm + said * self.scale_mm)
        return press_mm, np.ones_like(press_mm)

    def arrays(self) -> Arrays:
        """The model's arrays, by their names in its file."""
        layers = {
            f"network_{number}_{layer}_{name}": array
            for number, one in enumerate(self.networks)
            for layer, (weights, bias) in enumerate(zip(one.weights, one.biases, strict=True))
            for name, array in (("weights", weights), ("bias", bias))
        }
        shape = np.array([len(self.networks), len(self.networks[0].weights)])
        return (
            self.touch.arrays()
            | self.scaling.arrays("network")
            | layers
            | {
                "network_shape": shape,
                "network_activation": np.array([ACTIVATIONS.index(self.networks[0].activation)]),
                "network_mean_mm": self.mean_mm,
                "network_scale_mm": self.scale_mm,
            }
            | self.sigma.arrays()
        )


def network_of_arrays(header: ModelHeader, arrays: Arrays) -> NetworkModel:
    """Make the model from its header and arrays in a file; raises `InputError` if the arrays are inconsistent."""
    pairs = len(header.untouched_counts)
    scaling = scaling_of_arrays(arrays, "network", pairs)
    count, layers = (int(number) for number in taken(arrays, "network_shape", (2,)))
    activation = int(taken(arrays, "network_activation", (1,))[0])
    if not (1 <= count <= 100 and 1 <= layers <= 20 and 0 <= activation < len(ACTIVATIONS)):
        raise InputError(
            "network_shape: names numbers of networks, layers or an activation that are not known"
        )
    return NetworkModel(
        header=header,
        touch=touch_svm_of_arrays(arrays, pairs),
        scaling=scaling,
        networks=tuple(
            _network(arrays, number, layers, len(scaling.kept), ACTIVATIONS[activation])
            for number in range(count)
        ),
        mean_mm=taken(arrays, "network_mean_mm", (3,)),
        scale_mm=taken(arrays, "network_scale_mm", (3,)),
        sigma=sigma_table_of_arrays(arrays),
    )


def _network(arrays: Arrays, number: int, layers: int, inputs: int, activation: str) -> Network:
    """One network from a file's arrays. Consecutive layers must fit together; the last must have three outputs."""
    weights: list[NDArray[np.float32]] = []
    biases: list[NDArray[np.float32]] = []
    for layer in range(layers):
        wanted = (inputs, 3 if layer == layers - 1 else None)
        weights.append(taken(arrays, f"network_{number}_{layer}_weights", wanted).astype(np.float32))
        inputs = weights[-1].shape[1]
        biases.append(taken(arrays, f"network_{number}_{layer}_bias", (inputs,)).astype(np.float32))
    return Network(weights=tuple(weights), biases=tuple(biases), activation=activation)
