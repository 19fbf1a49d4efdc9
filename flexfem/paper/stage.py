"""The stage: the validated content of a stage file, and changed stages."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, ClassVar, Self

from flexfem.arrays import AnyArray
from flexfem.fem.mesh import SOLID_RESOLUTION
from flexfem.files.provenance import Assumptions
from flexfem.files.refusals import key_path
from flexfem.files.toml import PathLike
from flexfem.files.writing import canonical, digest
from flexfem.mechanism.content import naming_place, read_content
from flexfem.mechanism.dimensions import Callout, DrawingFacts, Span
from flexfem.mechanism.keys import Key
from flexfem.mechanism.layout import Layout
from flexfem.mechanism.unfinished import Unfinished
from flexfem.paper.actuators import Actuator
from flexfem.paper.designs import Elastic, design_arrays
from flexfem.paper.drawing import stage_callouts, stage_facts, stage_spans, with_mounting_holes
from flexfem.paper.drives import drive_of
from flexfem.paper.feasibility import check_closed_form
from flexfem.paper.stage_file import CHAINS as CHAINS
from flexfem.paper.stage_file import HINGE_NAMES as HINGE_NAMES
from flexfem.paper.stage_file import Hinge as Hinge
from flexfem.paper.stage_file import StageContent, actuators_of, hinges_of, of_drive, of_heat
from flexfem.paper.stage_layout import stage_layout

# module in `flexfem.paper` by question
ANSWERS: dict[str, str] = {
    "accepted_questions": "baseline",
    "check": "check",
    "converge": "convergence",
    "as_built": "as_built",
    "design_kind": "design",
    "drift": "drift",
    "budget": "budget",
    "drive": "drive",
    "family": "study",
    "forces": "forces",
    "gravity": "gravity",
    "large": "large",
    "life": "life",
    "modes": "modes",
    "reach": "reach",
    "stored_compliance": "baseline",
    "stored_mesh": "baseline",
    "stiffness": "stiffness",
    "summary": "summary",
    "write_mesh_of": "mesh_file",
}


class Stage(StageContent):
    """A planar 3-RRR flexure stage; `thickness` out of plane in mm, `provenance` by key path of the
    file.

    model : plane model; "corrected" uses hinges corrected by three-dimensional analyses, in the
    analytic model only.
    """

    solid_resolution: ClassVar[int] = SOLID_RESOLUTION
    not_exported: ClassVar[tuple[str, ...]] = (
        "the models clamp only the back edges of the pads and fill the hub hole with a rigid disc",
    )

    def replace(self, **changes: Any) -> Self:
        """Return a changed stage, validated and checked for feasibility; other values stay the same
        bit for bit.

        Parameters
        ----------
        **changes
            By attribute name, in mm, N, MPa and rad, nested as the tables are: `thickness=12.0`,
            `material={"youngs_modulus": 70e3}`, `chain={"link_width": 9.5}`; `material="ti-6al-4v"`
            takes a registered material. `radius`, `neck`, `prismatic` and `axis` are those of the
            hinges, one value for all three or by name, `neck={"elbow": 0.4}`; a hinge with an
            override keeps it. A single one of the nine hinges:
            `override={(2, "elbow"): {"neck": 0.52}}`; an actuator,
            `actuator={"base": {"preload": 40.0}}`, or on one chain,
            `override={(2, "actuator", "base"): {"preload": 40.0}}`. A sequence replaces all members
            of an array.

        Raises
        ------
        BadInput
            A name is not known, a value is not possible, or the stage cannot be made.

        Examples
        --------
        >>> import flexfem
        >>> stage = flexfem.load("geometry/mobility6.toml")
        >>> stage.replace(neck={"elbow": 0.4}).hinges.elbow.neck
        0.4
        >>> stage.replace(neck=20.0)  # doctest: +ELLIPSIS
        Traceback (most recent call last):
            ...
        flexfem.BadInput: geometry/mobility6.toml, changed: hinges.base.neck_mm = 20, neck ...
        """
        changed = self._replaced(changes)
        changed.check()
        if changed.actuator and ("actuator" in changes or changed.override != self.override):
            drive_of(changed)  # refuses a contact off its body
        return changed

    @property
    def lever(self) -> float:
        """Lever, mm: the distance l3 from the platform hinges to the centre of the platform."""
        return self.chain.link_lengths[2]

    def check(self) -> None:
        """Raise BadInput, with key, value and expectation, for a stage that cannot be made."""
        check_closed_form(self)
        super().check()

    def spans(self, layout: Layout) -> list[Span]:
        """Return the lengths of chain 1 for a drawing of a layout of this stage."""
        return stage_spans(self, layout)

    def callouts(self, layout: Layout) -> list[Callout]:
        """Return the texts of a workshop drawing of a layout of this stage."""
        return stage_callouts(self, layout)

    @property
    def drawing_facts(self) -> DrawingFacts:
        """What a drawing shows and states beside the outlines and sizes of the parts."""
        return stage_facts(self)

    def with_mounting_holes(self, diameter: float) -> Layout:
        """Return the layout with a hole, mm, in every pad. Raises BadInput for one as wide as it."""
        return with_mounting_holes(self, self.layout, diameter)

    def expected_of(self, key: Key) -> str | None:
        """Return what is expected instead of a key of an actuator that sets nothing, else None."""
        if not key.of_drive or key.places_in(self):
            return None
        names = ", ".join(actuator.name for actuator in self.actuator) or "it has none"
        return (
            f"a number that an actuator of the stage ({names}) states and that no override replaces"
        )

    @classmethod
    def answering(cls, question: str) -> Callable[..., Any] | None:
        """Return the function of the paper's room that answers a question, if there is one."""
        module = ANSWERS.get(question)
        if module is None:
            return None
        answer: Callable[..., Any] = getattr(import_module(f"flexfem.paper.{module}"), question)
        return answer

    def array(self, attr: str) -> AnyArray:
        """Return radius, neck (mm) or prismatic (bool) of all hinges, (3 chains, 3 hinges),
        read-only.
        """
        if attr not in ("radius", "neck", "prismatic"):
            raise ValueError(f"no array of {attr!r}: expected radius, neck or prismatic")
        values: AnyArray = getattr(design_arrays(self), attr)
        return values if attr == "prismatic" else values[0]

    @property
    def layout(self) -> Layout:
        """The stage as any other mechanism: pads, links, platform and hinges. Raises BadInput as
        `stage_layout`.
        """
        with naming_place(self):
            return stage_layout(self)

    @property
    def layout_as_drawn(self) -> Layout:
        """The layout for drawings; strips stand for bodies that cannot be drawn."""
        return stage_layout(self, refuse=False)

    @property
    def mobility(self) -> int:
        """Mobility by Gruebler-Kutzbach (1): three plus the number of prismatic hinges."""
        return 3 + int(self.array("prismatic").sum())  # (1)

    @property
    def elastic(self) -> Elastic:
        """Elastic constants of the plane problem of `model`; those of the bulk are in `material`."""
        return Elastic(*(value[0] for value in design_arrays(self).elastic))

    @property
    def chains_alike(self) -> bool:
        """Whether all chains have equal hinges, so that the stage is three-fold symmetric."""
        return len(set(hinges_of(self))) == 1

    @property
    def hash(self) -> str:
        """SHA-256 of the physical content, overrides applied; names, provenance, drive and
        expansion are excluded.
        """
        # keeps hashes that are older than the key
        old = {"model"} if self.model == "plane_stress" else set[str]()
        hinges = [[hinge.model_dump() for hinge in chain] for chain in hinges_of(self)]
        return self._digest({"override", "actuator", *old}, {"hinges": hinges})

    @property
    def drive_hash(self) -> str:
        """SHA-256 of the physical content and of the drive, without names, on which results of a
        driven stage depend.

        Unstated friction and balls that are not loose are left out, which keeps hashes older than
        those keys."""

        def content(actuator: Actuator) -> list[Any]:
            excluded = {"name", "stack"} | ({"friction"} if actuator.friction is None else set())
            excluded |= set() if actuator.ball_loose else {"ball_loose"}
            return [actuator.model_dump(exclude=excluded), actuator.rating]

        chains = [[content(actuator) for actuator in row] for row in actuators_of(self)]
        identical = all(chain == chains[0] for chain in chains)
        return digest(canonical({"stage": self.hash, "drive": chains[0] if identical else chains}))

    @property
    def heat_hash(self) -> str:
        """SHA-256 of the physical content and of both coefficients of expansion, on which thermal
        results depend.
        """
        return digest(
            canonical(
                {"stage": self.hash, "expansion": [self.material.expansion, self.frame.expansion]}
            )
        )

    @property
    def numbers(self) -> tuple[str, ...]:
        """Key paths of all numbers except those of the drive and of expansion, which few results
        depend on.
        """
        return tuple(key for key in super().numbers if not of_drive(key) and not of_heat(key))

    @property
    def assumed(self) -> tuple[str, ...]:
        """Key paths of assumed numbers, except those of the drive and of expansion."""
        return tuple(key for key in super().assumed if not of_drive(key) and not of_heat(key))

    @property
    def heat_assumptions(self) -> Assumptions:
        """Assumed and unstated numbers, expansion included; an unstated expansion of the frame is
        assumed.
        """
        assumed, not_stated = (
            [key for key in keys if not of_drive(key)] for keys in self.drive_assumptions
        )
        frame = ["frame.expansion_um_per_m_k"] if self.frame.expansion is None else []
        return Assumptions(assumed + frame, not_stated)

    @property
    def drive_assumptions(self) -> Assumptions:
        """Assumed and unstated numbers, drive included; a ball without a stated material is assumed
        to be of steel.
        """
        ball = [
            f"{key_path(('actuator', k), self)}.ball ({assumption})"
            for k, actuators in enumerate(zip(*actuators_of(self), strict=True))
            for assumption in dict.fromkeys(
                text for actuator in actuators for text in actuator.assumed_of_ball
            )
        ]
        sources = self.sources
        return Assumptions(
            [*super().assumed, *ball], [key for key in super().numbers if sources[key] is None]
        )


def load_stage(path: PathLike) -> Stage:
    """Read a stage file. Raises BadInput, naming file, line, key, value and expectation, for
    invalid content.
    """
    return read_content(Stage, path)


def read_unchecked(path: PathLike) -> Unfinished:
    """Read a stage for a drawing, whether or not it can be made. Raises BadInput as `load_stage`."""
    return Unfinished(load_stage(path), None, [])


def load_feasible(path: PathLike) -> Stage:
    """Read a stage file. Raises BadInput, naming the file, also for a stage that cannot be made or
    driven.
    """
    stage = load_stage(path)
    stage.check()
    if stage.actuator:
        drive_of(stage)  # refuses a contact off its body
    return stage
