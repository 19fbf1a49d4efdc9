"""Reduced dynamics of a stage: modal state space with static correction, frequency response, Craig-Bampton.

Units are mm, N, tonne, s and rad, which go together: forces in N move masses in tonne by mm/s^2.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexfem.arrays import Array
from flexfem.fem.modes import Modes, VibratingStructure, lowest
from flexfem.files.writing import replacing, write_atomically
from flexfem.mechanism.drives import StageDrive
from flexfem.mechanism.stage_file import counted
from flexfem.refused import BadInput
from flexfem.units import DIRECTIONS, FORCES, LENGTH, POSES

UNITS = "mm, N, tonne, s, rad"


class Channels(NamedTuple):
    """Names and units of inputs or outputs."""

    names: tuple[str, ...]
    units: tuple[str, ...]


class StateSpace(NamedTuple):
    """`s' = A s + B u`, `y = C s + D u`; the state is modal displacements, then their rates. D is the static compliance
    of the modes that are left out, so that the response at rest is exact."""

    A: Array
    B: Array
    C: Array
    D: Array


class CraigBampton(NamedTuple):
    """Reduced stiffness and mass (3 + k, 3 + k) of pose x, y, theta and k modes with the platform held, loads
    (3 + k, inputs) per input: `M q'' + K q = L u`. Truncated: its frequencies are above those of all freedoms."""

    stiffness: Array
    mass: Array
    loads: Array


class DynamicModel(NamedTuple):
    """How the pose of the platform answers loads on it and, of an engaged drive, commands.

    frequencies : (k,), rad/s.   drive, read : (k, inputs) and (3, k), shapes at the inputs and of the pose.
    residual : (3, inputs), what the modes left out add at rest.   damping : of every mode, over critical; assumed.
    """

    frequencies: Array
    drive: Array
    read: Array
    residual: Array
    damping: float
    inputs: Channels
    outputs: Channels
    craig_bampton: CraigBampton

    @property
    def state_space(self) -> StateSpace:
        """As matrices of first order."""
        k, n = len(self.frequencies), self.drive.shape[1]
        rates = np.hstack([-np.diag(self.frequencies**2), -np.diag(2 * self.damping * self.frequencies)])
        A = np.vstack([np.hstack([np.zeros((k, k)), np.eye(k)]), rates])
        C = np.hstack([self.read, np.zeros((3, k))])
        return StateSpace(A, np.vstack([np.zeros((k, n)), self.drive]), C, self.residual)

    @property
    def truncation(self) -> Array:
        """By how many per cent (k,) the lowest frequencies of the Craig-Bampton matrices are above `frequencies`."""
        from scipy.linalg import eigh

        squares = eigh(self.craig_bampton.stiffness, self.craig_bampton.mass, eigvals_only=True)
        return np.asarray(100 * (np.sqrt(squares[: len(self.frequencies)]) / self.frequencies - 1))

    @property
    def truncation_note(self) -> str:
        """What is to be known of the Craig-Bampton matrices, in a sentence."""
        above, kept = self.truncation, counted(len(self.frequencies), "mode", "modes")
        return (
            f"K_cb and M_cb are truncated, {kept} with the platform held: by them as many lowest frequencies are "
            f"{max(above.min(), 0.0):.2g} to {above.max():.2g} % above those of all freedoms"
        )

    def response(self, frequencies: Array) -> Any:
        """Complex response (f, 3, inputs), pose per input, at frequencies (f,), rad/s."""
        w, own = np.asarray(frequencies, dtype=float)[:, None], self.frequencies
        gain = 1 / (own**2 - w**2 + 2j * self.damping * own * w)
        return np.einsum("ok,fk,ki->foi", self.read, gain, self.drive) + self.residual

    def control(self) -> Any:
        """As python-control's StateSpace. Raises BadInput when it is not installed."""
        try:
            control = import_module("control")
        except ImportError as error:
            raise BadInput(f"python-control cannot be loaded ({error}), expected it installed") from None
        return control.ss(*self.state_space, inputs=list(self.inputs.names), outputs=list(self.outputs.names))

    def arrays(self) -> dict[str, Any]:
        """All arrays by name, with names and units of inputs and outputs, for files."""
        named = {"inputs": self.inputs.names, "input_units": self.inputs.units}
        named |= {"outputs": self.outputs.names, "output_units": self.outputs.units}
        words = {name: np.array(texts) for name, texts in named.items()}
        reduced = dict(zip(("K_cb", "M_cb", "L_cb"), self.craig_bampton, strict=True))
        found = {"frequencies_rad_per_s": self.frequencies, "damping_ratio": np.array(self.damping)}
        found |= {"K_cb_above_percent": self.truncation, "K_cb_note": np.array(self.truncation_note)}
        return self.state_space._asdict() | reduced | found | words | {"units": np.array(UNITS)}

    def write(self, path: Path) -> None:
        """Write `arrays` by the file's extension, .npz or MATLAB's .mat. Raises BadInput."""
        if path.suffix not in (".npz", ".mat"):
            raise BadInput(f"{path}: extension {path.suffix!r}, expected .npz or .mat")
        arrays = self.arrays()
        if path.suffix == ".npz":
            write_atomically(path, lambda file: np.savez(file, **arrays))
            return
        from scipy.io import savemat

        texts = {name for name, value in arrays.items() if value.ndim and value.dtype.kind == "U"}  # cells of MATLAB
        with replacing(path) as temporary:
            savemat(temporary, arrays | {name: arrays[name].astype(object) for name in texts}, oned_as="column")


def reduced_dynamics(of: VibratingStructure, modes: Modes, damping: float, drive: StageDrive | None) -> DynamicModel:
    """The reduced dynamics of a structure by some of its modes; drive : engaged, its commands are inputs."""
    loads = np.zeros((of.structure.size, 3))
    loads[-3:] = np.eye(3)
    names, units = [f"load {name}" for name in DIRECTIONS], [str(unit) for unit in FORCES]
    if drive is not None:
        loads = np.hstack([loads, of.pushes @ (of.rates[:, None] * drive.differential)])
        names += [f"stroke {name}" for name in drive.names]
        units += [str(LENGTH)] * len(drive.names)
    at_rest = of.space.solve(loads)
    shapes_in, shapes_out = modes.shapes[0].T @ loads, modes.shapes[0, -3:]
    residual = at_rest[-3:] - (shapes_out / modes.frequencies**2) @ shapes_in
    return DynamicModel(
        modes.frequencies,
        shapes_in,
        shapes_out,
        residual,
        damping,
        Channels(tuple(names), tuple(units)),
        Channels(tuple(f"pose {name}" for name in DIRECTIONS), tuple(str(unit) for unit in POSES)),
        craig_bampton(of, at_rest[:, :3], loads, len(modes.frequencies)),
    )


def craig_bampton(of: VibratingStructure, static: Array, loads: Array, count: int) -> CraigBampton:
    """Reduce to the pose and `count` modes with the platform held.

    Parameters
    ----------
    static : (m, 3), what unit loads on the platform do.   loads : (m, inputs).

    Notes
    -----
    With `X = K^-1 E` the constraint modes are `X (E' X)^-1`; the inverse of the stiffness with the platform held is
    `K^-1 - X (E' X)^-1 X'`. R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313.
    """
    from scipy.sparse.linalg import LinearOperator

    K_pose = np.linalg.inv((static[-3:] + static[-3:].T) / 2)

    def held(b: Array) -> Array:
        whole = np.vstack([b, np.zeros((3, b.shape[1]))])
        return np.asarray((of.space.solve(whole) - static @ (K_pose @ (static.T @ whole)))[:-3])

    def inertia(b: Array) -> Array:
        return of.inertia(np.vstack([b.reshape(len(static) - 3, -1), np.zeros((3, b.size // (len(static) - 3)))]))[:-3]

    size = len(static) - 3
    squares, shapes = lowest(held, LinearOperator((size, size), matvec=inertia, dtype=float), count)
    shapes = shapes / np.sqrt(np.einsum("ik,ik->k", shapes, inertia(shapes)))
    T = np.hstack([static @ K_pose, np.vstack([shapes, np.zeros((3, count))])])
    T[-3:] = np.eye(3, 3 + count)
    K = np.zeros((3 + count, 3 + count))
    K[:3, :3], K[3:, 3:] = K_pose, np.diag(squares)
    return CraigBampton(K, T.T @ of.inertia(T), T.T @ loads)
