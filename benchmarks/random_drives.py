"""Driven random stages: calibrated hinges with elastic links against finite elements, pose by
stroke and all of C.

    python benchmarks/random_drives.py [--stages 40] [--seed 2003] [--resolution 8]

Stages as in random_stages.py. Each is driven as the paper's, by pairs between the frame and link 1
and between link 2 and link 1 of every chain, with contacts, directions and stiffnesses drawn."""

from __future__ import annotations

import argparse

import numpy as np
from random_stages import described, drawn

from flexfem.arrays import Array
from flexfem.paper.bodies import centrelines
from flexfem.paper.commanding import commanding, driven_elements, push_spread
from flexfem.paper.model import CALIBRATED, ModelChoice
from flexfem.paper.stage import Stage
from flexfem.refused import BadInput

CARRIERS = ("frame", "link 2")


def with_drive(stage: Stage, rng: np.random.Generator, preload: float = 0.0) -> Stage:
    """The stage with a drive drawn: contacts 20 to 80 % of the way along link 1, up to 20 degrees
    off its normal.

    preload : of every stack, as a share of its blocking force.
    """
    path = centrelines(stage, 1)[1]
    length = sum(segment.length for segment in path)
    while True:
        actuators = []
        for name in CARRIERS:
            s = length * rng.uniform(0.2, 0.8)
            side = rng.choice([-1, 1])
            for segment in path:
                if s <= segment.length:
                    break
                s -= segment.length
            normal = 1j * side * segment.tangent(np.array(s / segment.length))
            point = segment.at(np.array(s / segment.length)) + normal * stage.chain.link_width / 2
            actuators.append(
                {
                    "name": name,
                    "between": (name, "link 1"),
                    "point": (float(point.real), float(point.imag)),
                    "direction": float(np.angle(-normal) + np.deg2rad(rng.uniform(-20, 20))),
                    "pair": True,
                    "stroke": 0.0174,
                    "stiffness": float(10 ** rng.uniform(3.5, 5)),
                }
            )
        for each in actuators:
            each["preload"] = preload * each["stroke"] * each["stiffness"]
        try:
            return stage.replace(actuator=actuators)
        except BadInput:
            continue


def deviations(stage: Stage, resolution: int) -> Array:
    """Per cent (5,): of C, per root of its diagonals; of the pose by strokes for a pose; of C of
    the platform alone; of the engaged stiffness; and how much that moves with how pushes spread, by
    the model."""
    model = commanding(ModelChoice(stage, None, CALIBRATED, True))
    metal = driven_elements(stage, resolution)
    C = model.system.C
    F = metal.system.C
    size = np.sqrt(np.diag(F))
    off = np.abs(C - F) / np.outer(size, size)
    lever = stage.chain.link_lengths[2]
    scale = np.array([1, 1, lever])
    missed = []
    for pose in np.diag(1e-3 / scale):
        x = model.system.commands(pose, np.zeros(3), lever, "least energy")
        missed.append(np.abs((metal.system.moved(x, np.zeros(3)).pose - pose) * scale) / 1e-3)
    engaged = metal.system.stiffness
    of_engaged = [model.system.stiffness / engaged - 1, push_spread(model) / engaged]
    return 100 * np.array(
        [np.max(off), np.max(missed), np.max(off[:3, :3]), *np.max(np.abs(of_engaged), axis=1)]
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--stages", type=int, default=40)
    parser.add_argument("--seed", type=int, default=2003)
    parser.add_argument("--resolution", type=int, default=8)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    found = []
    stages = []
    for stage in drawn(arguments.stages, arguments.seed):
        stages.append(with_drive(stage, rng))
        found.append(deviations(stages[-1], arguments.resolution))
        print(f"{len(found):3}  {found[-1].round(3)}", flush=True)
    print(
        "per cent: compliance of platform and stacks, pose by strokes, compliance of the "
        "platform alone, engaged"
    )
    print("stiffness, and how much that moves with how pushes spread")
    print("median", np.median(found, axis=0).round(3))
    print("worst ", np.max(found, axis=0).round(3))
    worst = int(np.argmax(np.max(found, axis=1)))
    print(f"worst stage: {worst + 1}, {described(stages[worst])}")


if __name__ == "__main__":
    main()
