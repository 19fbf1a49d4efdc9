"""What every question takes: the analytic model, the models that answer, the meshes; and what its result is of."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from flexfem import arguments
from flexfem.analytic.model import ModelChoice, choose, model_of
from flexfem.fem.mesh import RESOLUTION, SOLID_RESOLUTION, mesh_sectors
from flexfem.fem.response import Response, unit_response
from flexfem.fem.structure import plate_of
from flexfem.mechanism.dimensioned import once
from flexfem.mechanism.stage import Stage
from flexfem.refused import BadInput
from flexfem.results import About

Models: TypeAlias = Literal["both", "analytic", "elements"]


class Analytic(NamedTuple):
    """The analytic model of a question.

    Without any of these it has calibrated hinges and elastic links, and is corrected for the thickness of the hinges
    unless the stage file states a `model`. With any of them it is the paper's model with that change.

    Parameters
    ----------
    mobility : int, optional
        Mobility of the stage with rigid links: 3, 6, 12 or 21.
    formula : str, optional
        Formula of the hinges, see `flexfem formulas`.
    links : bool
        Pads, links and platform are elastic; with mobility 21 alone.
    """

    mobility: int | None = None
    formula: str | None = None
    links: bool = False

    def chosen(self, stage: Stage, warnings: list[str]) -> ModelChoice:
        """The model of a stage; adds warnings where a chart does not reach. Raises BadInput."""
        if self.links and self.mobility not in (None, 21):
            raise BadInput(
                f"links with mobility {self.mobility}, expected 21 or None: elastic links go with all freedoms"
            )
        return choose(stage, model_of(*self), warnings)


DEFAULT = Analytic()


class Mesh(NamedTuple):
    """The finest mesh of finite elements: triangles across every neck, and layers in half the thickness.

    layers : 0 in the plane.
    """

    resolution: int
    layers: int


def mesh_of(
    models: Models, resolution: int | None, layers: int | None, least: int = 4, least_solid: int = 4
) -> Mesh | None:
    """The mesh that was asked for, None without finite elements.

    Parameters
    ----------
    layers : int or None
        None in the plane, otherwise three dimensions.
    least, least_solid : int
        Least resolutions in the plane and in three dimensions.

    Raises
    ------
    BadInput
        A mesh without finite elements, or one that is too coarse or too fine.
    """
    if models == "analytic":
        for name, value in (("resolution", resolution), ("layers", layers)):
            if value is not None:
                raise BadInput(f"{name} {value} with models 'analytic', expected finite elements to mesh")
        return None
    if layers is None:
        return Mesh(arguments.resolution(RESOLUTION if resolution is None else resolution, least), 0)
    finest = arguments.resolution(SOLID_RESOLUTION if resolution is None else resolution, least_solid)
    return Mesh(finest, arguments.layers(layers, 3))


@once
def solved(stage: Stage, resolution: int) -> Response:
    """Plane finite elements of a feasible stage, solved once. Raises BadInput for a model that is not plane."""
    return unit_response(mesh_sectors(stage, resolution), plate_of(stage))


def meshed(mesh: Mesh | None) -> dict[str, int | None]:
    """A mesh as settings of a result."""
    return {} if mesh is None else {"resolution": mesh.resolution, "layers": mesh.layers or None}


def about(stage: Stage, heat: bool = False, drive: bool = False) -> About:
    """What a result is of; with `heat` also by the coefficients of expansion, with `drive` by the drive."""
    doubts = stage.heat_doubts if heat else stage.drive_doubts if drive else stage
    own = stage.heat_hash if heat else stage.drive_hash if drive else stage.hash
    lever = stage.chain.link_lengths[2]
    return About(stage.name, str(stage.origin), own, tuple(doubts.assumed), tuple(doubts.not_stated), lever)
