"""Reduced dynamics of the platform of a stage: state space and Craig-Bampton matrices."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array, short_repr
from flexfem.fem.modes import Modes, VibratingStructure, lowest
from flexfem.files.provenance import counted
from flexfem.files.writing import replacing, write_atomically
from flexfem.mechanism.layout import ActuatorSet
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, FORCES, LENGTH, POSES


class Channels(NamedTuple):
    """Names and units of inputs or outputs."""

    names: tuple[str, ...]
    units: tuple[str, ...]


OUTPUTS = Channels(tuple(f"pose {name}" for name in DIRECTIONS), tuple(map(str, POSES)))


class StateSpace(NamedTuple):
    """`s' = A s + B u`, `y = C s + D u`, s: modal displacements and rates; D is the static part of
    omitted modes.
    """

    A: Array
    B: Array
    C: Array
    D: Array


class CraigBampton(NamedTuple):
    """`M q'' + K q = L u` of pose x, y, theta and k modes with the platform held: (3 + k, 3 + k),
    (3 + k, inputs).
    """

    stiffness: Array
    mass: Array
    loads: Array


@short_repr
class DynamicModel(NamedTuple):
    """Response of the platform's pose to loads on it and commands of an engaged drive, in mm, N,
    tonne, s and rad.

    frequencies : (k,), rad/s.   drive, read : (k, inputs) and (3, k), shapes at the inputs and of
    the pose.
    residual : (3, inputs), static part of omitted modes.   damping : of every mode, over critical;
    assumed."""

    frequencies: Array
    drive: Array
    read: Array
    residual: Array
    damping: float
    inputs: Channels
    craig_bampton: CraigBampton
    outputs: Channels = OUTPUTS

    @property
    def state_space(self) -> StateSpace:
        """The model in state space."""
        k = len(self.frequencies)
        n = self.drive.shape[1]
        rates = np.hstack(
            [-np.diag(self.frequencies**2), -np.diag(2 * self.damping * self.frequencies)]
        )
        A = np.vstack([np.eye(k, 2 * k, k), rates])
        C = np.hstack([self.read, np.zeros((3, k))])
        return StateSpace(A, np.vstack([np.zeros((k, n)), self.drive]), C, self.residual)

    @property
    def truncation(self) -> Array:
        """Relative error (k,), per cent, of the lowest frequencies of the Craig-Bampton matrices,
        positive above.
        """
        from scipy.linalg import eigh

        squares = eigh(self.craig_bampton.stiffness, self.craig_bampton.mass, eigvals_only=True)
        return np.asarray(100 * (np.sqrt(squares[: len(self.frequencies)]) / self.frequencies - 1))

    @property
    def truncation_note(self) -> str:
        """The `truncation` in a sentence."""
        above = self.truncation
        kept = counted(len(self.frequencies), "mode", "modes")
        return (
            f"K_cb and M_cb are truncated to {kept} with the platform held: as many of their "
            f"lowest frequencies are {max(above.min(), 0.0):.2g} to {above.max():.2g} % above "
            "those of the full model"
        )

    def response(self, frequencies: Array) -> Any:
        """Return the complex response (f, 3, inputs), pose per input, at frequencies, rad/s."""
        w = np.asarray(frequencies, dtype=float)[:, None]
        natural = self.frequencies
        gain = 1 / (natural**2 - w**2 + 2j * self.damping * natural * w)
        return np.einsum("ok,fk,ki->foi", self.read, gain, self.drive) + self.residual

    def arrays(self) -> dict[str, Any]:
        """Return all arrays for a file by name, with names and units of inputs and outputs."""
        matrices = self.state_space._asdict() | dict(
            zip(("K_cb", "M_cb", "L_cb"), self.craig_bampton, strict=True)
        )
        others = {
            "frequencies_rad_per_s": self.frequencies,
            "damping_ratio": self.damping,
            "K_cb_above_percent": self.truncation,
            "K_cb_note": self.truncation_note,
            "inputs": self.inputs.names,
            "input_units": self.inputs.units,
            "outputs": self.outputs.names,
            "output_units": self.outputs.units,
            "units": "mm, N, tonne, s, rad",
        }
        return matrices | {name: np.array(value) for name, value in others.items()}

    def write(self, path: Path) -> None:
        """Write `arrays` to a file of extension .npz or .mat (MATLAB). Raises BadInput for another
        extension.
        """
        if path.suffix not in (".npz", ".mat"):
            raise BadInput(f"{path}: extension {path.suffix!r}, expected .npz or .mat")
        arrays = self.arrays()
        if path.suffix == ".npz":
            write_atomically(path, lambda file: np.savez(file, **arrays))
            return
        from scipy.io import savemat

        cells = {  # of MATLAB
            name: value.astype(object)
            for name, value in arrays.items()
            if value.ndim and value.dtype.kind == "U"
        }
        with replacing(path) as temporary:
            savemat(temporary, arrays | cells, oned_as="column")


def reduced_model(
    body: VibratingStructure, modes: Modes, ratio: float, drive: ActuatorSet | None
) -> DynamicModel:
    """Return the dynamics of a structure by some of its modes, with a damping ratio of all.

    Inputs are loads on the platform, then the commands of an engaged drive.
    """
    inputs = _inputs(body, drive)
    at_rest = body.space.solve(inputs.loads)
    gains = modes.shapes.T @ inputs.loads
    poses = modes.shapes[-3:]
    residual = at_rest[-3:] - (poses / modes.frequencies**2) @ gains
    platform = _craig_bampton(body, at_rest[:, :3], inputs.loads, len(modes.frequencies))
    return DynamicModel(modes.frequencies, gains, poses, residual, ratio, inputs.channels, platform)


class Inputs(NamedTuple):
    """Loads (size, inputs) on the unknowns of a structure for unit inputs, and what these are."""

    loads: Array
    channels: Channels


def _inputs(body: VibratingStructure, drive: ActuatorSet | None) -> Inputs:
    """Return loads on the platform, then those of the commands of an engaged drive."""
    size = body.structure.size
    loads = np.eye(size, 3, 3 - size)
    names = [f"load {name}" for name in DIRECTIONS]
    units = list(map(str, FORCES))
    if drive is not None:
        forces = body.stack_stiffness[:, None] * drive.differential
        loads = np.hstack([loads, body.stack_loads @ forces])
        names += [f"stroke {name}" for name in drive.names]
        units += [str(LENGTH)] * len(drive.names)
    return Inputs(loads, Channels(tuple(names), tuple(units)))


def _craig_bampton(
    body: VibratingStructure, static: Array, loads: Array, count: int
) -> CraigBampton:
    """Reduce to the pose and `count` modes with the platform held.

    static : (m, 3), solution under unit loads on the platform.

    Notes
    -----
    With `X = K^-1 E` the constraint modes are `X (E' X)^-1`; the inverse of the stiffness with the
    platform held is `K^-1 - X (E' X)^-1 X'`. R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313.
    """
    from scipy.sparse.linalg import LinearOperator

    K_pose = np.linalg.inv((static[-3:] + static[-3:].T) / 2)
    size = len(static) - 3

    def held(b: Array) -> Array:
        load = np.pad(b, ((0, 3), (0, 0)))
        free = body.space.solve(load)
        return np.asarray((free - static @ (K_pose @ (static.T @ load)))[:-3])

    def inertia(b: Array) -> Array:
        return body.mass.loads(np.pad(b.reshape(size, -1), ((0, 3), (0, 0))))[:-3]

    mass = LinearOperator((size, size), matvec=inertia, dtype=float)
    squares, shapes = lowest(held, mass, count)
    shapes = shapes / np.sqrt(np.einsum("ik,ik->k", shapes, inertia(shapes)))
    T = np.hstack([static @ K_pose, np.pad(shapes, ((0, 3), (0, 0)))])
    T[-3:] = np.eye(3, 3 + count)
    K = np.zeros((3 + count, 3 + count))
    K[:3, :3] = K_pose
    K[3:, 3:] = np.diag(squares)
    return CraigBampton(K, T.T @ body.mass.loads(T), T.T @ loads)
