"""What else could have produced the paper's error curves: other models, other finite elements, other stages.

Each alternative is put in the place of the model or of the metal in the comparison of Section V, and its errors are
measured on the same two stages. That one of them looks like the paper's curves does not show that it was their cause.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from flexfem.analytic.kinematics import freedoms_of
from flexfem.analytic.links import body_compliance
from flexfem.analytic.model import CALIBRATED, DEFAULT_FORMULA, analyse, assemble, at_rest, hinge_compliances
from flexfem.analytic.stiffness import stiffness
from flexfem.arrays import Array, inverse
from flexfem.fem.cyclic import cyclic_response
from flexfem.fem.factor import factorise
from flexfem.fem.mesh import RESOLUTION, StageMesh
from flexfem.fem.plane_stress import Plate
from flexfem.fem.response import plate_of, tie_hub
from flexfem.fem.sectors import uneven_sectors, welded
from flexfem.files.writing import markdown_table
from flexfem.stage.designs import lower
from flexfem.stage.schema import HINGE_NAMES, Hinge, Stage
from flexfem.units import MICROMETRE
from flexfem.verify.case import DIRECTIONS
from flexfem.verify.errors import error_matrix
from flexfem.verify.protocol import Solve
from flexfem.verify.result import Record, Triple

ACROSS = (1, 2, 4, 8)  # linear triangles across every neck
UNEVEN = ((1, 2, 2), (3, 4, 4))  # triangles across the necks of the three sectors; their cuts have the same nodes
STUBBY = (3.0, 1.0)  # R/t of all nine hinges
SCATTER, DRAWS, SEED = 0.005, 200, 2003  # mm, standard deviation of the necks; stages; seed
QUANTILES = {"median": 0.5, "95 %": 0.95}
INFERENCE = (
    "Measured: the numbers. Inference: that any of these was at work in the paper. Its meshes, elements, dimensions and"
    " curves are not available, so an alternative that resembles its statements is a possible cause and no more."
)


class Alternative(Record):
    """Errors of one alternative, per cent.

    mobility : of the model.   along : error in the commanded direction for commands in x, y, theta.
    across : largest magnitude in the two other directions for each of them.
    """

    name: str
    mobility: int
    along: Triple
    across: Triple


def alternatives(three: Stage, six: Stage, solve: Solve) -> list[Alternative]:
    """Every alternative for the stages modelled with mobility three and six. Raises BadInput, ComputationFailed."""
    found = []
    for stage, mobility in ((three, 3), (six, 6)):
        found += [*_finite_elements(stage, mobility, solve), *_stages(stage, mobility)]
    lever = six.chain.link_lengths[2]
    without = error_matrix(analyse(six, 3).stiffness, solve(six, RESOLUTION).response.compliance, lever)
    found.append(_row("axial freedom left out, on the mobility-six stage", 3, without))
    for ratio in STUBBY:
        stage = with_necks(six, ratio)
        real = analyse(stage, 21).compliance
        for mobility in (3, 6):
            name = f"R/t = {ratio:g} in the mobility-six stage, all freedoms as metal"
            found.append(_row(name, mobility, error_matrix(analyse(stage, mobility).stiffness, real, lever)))
            found.append(_row(f"{name}, joints commanded", mobility, joint_command(stage, mobility, DEFAULT_FORMULA)))
    return found


def _finite_elements(stage: Stage, mobility: int, solve: Solve) -> list[Alternative]:
    """The same stage and model against other finite elements."""
    K, lever, plate = analyse(stage, mobility).stiffness, stage.chain.link_lengths[2], plate_of(stage)

    def row(name: str, compliance: Array) -> Alternative:
        return _row(name, mobility, error_matrix(K, compliance, lever))

    fine, held = solve(stage, RESOLUTION), plate_of(stage.model_copy(update={"model": "plane_strain"}))
    found = [row("none: curved quadratic triangles, as verified", fine.response.compliance)]
    for n in ACROSS:
        found.append(row(f"linear triangles, {n} across every neck", linear_compliance(solve(stage, n).mesh, plate)))
    for across in UNEVEN:
        sectors, said = uneven_sectors(stage, across), ", ".join(map(str, across))
        found.append(row(f"asymmetric mesh, {said} linear triangles", linear_compliance(welded(sectors)[0], plate)))
        found.append(row(f"asymmetric mesh, {said} quadratic triangles", cyclic_response(sectors, plate).compliance))
    found.append(
        row(
            "finite elements in plane strain, the limit of wide necks",
            cyclic_response(fine.response.sectors, held).compliance,
        )
    )
    return found


def _stages(stage: Stage, mobility: int) -> list[Alternative]:
    """The same model against a stage that is made inexactly, or that is driven at its joints."""
    percent = np.abs(scatter(stage, mobility))
    deviation = f"{MICROMETRE.factor * SCATTER:g} {MICROMETRE.plain}"
    found = []
    for name, share in QUANTILES.items():
        size = np.quantile(percent, share, axis=0)
        found.append(_row(f"necks scattered by {deviation}, {name} of {DRAWS} stages", mobility, size))
    return [*found, _row("joints commanded instead of the platform", mobility, joint_command(stage, mobility))]


def linear_compliance(mesh: StageMesh, plate: Plate) -> Array:
    """Platform compliance (3, 3) with straight linear triangles on the corners of a mesh, in x, y, theta.

    Notes
    -----
    `K = b A B^T D B` with constant strain; the hub is tied as in `response.platform_response`.
    """
    corners = int(mesh.triangles[:, :3].max()) + 1  # the first nodes, see `mesh.ordered`
    edges = {name: edge[:, :2] for name, edge in mesh.edges.items()}
    straight = StageMesh(mesh.nodes[:corners], mesh.triangles[:, :3], mesh.bodies, edges)
    tied = tie_hub(straight)
    free = 2 * len(tied.free)
    T = sp.block_diag([sp.eye_array(free), tied.rigid], format="csr")
    kept = (2 * np.concatenate([tied.free, tied.hub])[:, None] + np.arange(2)).ravel()
    K = _linear_stiffness(straight, plate)[kept][:, kept]
    loads = np.zeros((free + 3, 3))
    loads[free:] = np.eye(3)
    return np.asarray(factorise(sp.tril(T.T @ K @ T).tocoo())(loads)[free:])


def _linear_stiffness(mesh: StageMesh, plate: Plate) -> sp.csr_array:
    """Stiffness matrix (2n, 2n) of linear triangles (m, 3), N/mm."""
    at = mesh.nodes[mesh.triangles]
    sides = np.roll(at, -2, axis=1) - np.roll(at, -1, axis=1)  # opposite to each corner
    area = 0.5 * (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    gradient = np.stack([-sides[..., 1], sides[..., 0]], axis=-1) / (2 * area)[:, None, None]
    B = np.zeros((len(at), 3, 6))
    B[:, 0, 0::2], B[:, 1, 1::2] = gradient[..., 0], gradient[..., 1]
    B[:, 2, 0::2], B[:, 2, 1::2] = gradient[..., 1], gradient[..., 0]
    lame, mu = plate.lame
    D = np.array([[lame + 2 * mu, lame, 0.0], [lame, lame + 2 * mu, 0.0], [0.0, 0.0, mu]])
    K = (plate.thickness * area)[:, None, None] * (B.transpose(0, 2, 1) @ D @ B)
    place = (2 * mesh.triangles[..., None] + np.arange(2)).reshape(len(at), 6)
    rows, columns = np.repeat(place, 6, axis=1).ravel(), np.tile(place, 6).ravel()
    size = 2 * len(mesh.nodes)
    return sp.coo_array((K.ravel(), (rows, columns)), shape=(size, size)).tocsr()


def with_necks(stage: Stage, ratio: float) -> Stage:
    """The stage with the necks thickened or thinned to R/t = ratio in every hinge; overrides are dropped.

    Links are widened where a notch needs it; the rigid-link models here do not know their width.
    """
    hinges: dict[str, Hinge] = {name: getattr(stage.hinges, name) for name in HINGE_NAMES}
    changed = {name: hinge.model_copy(update={"neck": hinge.radius / ratio}) for name, hinge in hinges.items()}
    widest = max(2 * hinge.radius + hinge.neck for hinge in changed.values())
    chain = stage.chain.model_copy(update={"link_width": max(stage.chain.link_width, widest)})
    return stage.model_copy(update={"chain": chain, "hinges": stage.hinges.model_copy(update=changed), "override": ()})


def scatter(stage: Stage, mobility: int, deviation: float = SCATTER, draws: int = DRAWS, seed: int = SEED) -> Array:
    """Error percentages (draws, 3, 3) of stages whose nine necks are normally scattered, mm, about the drawn ones.

    The metal is the calibrated hinges with elastic pads, links and platform; the model knows the drawn dimensions.
    """
    lever, noise = stage.chain.link_lengths[2], np.random.default_rng(seed).normal(size=(draws, 3, 3))
    designs = lower(stage).repeated(draws)
    designs.neck[:] += deviation * noise
    hinges = hinge_compliances(designs, CALIBRATED)
    real = inverse(at_rest(designs, hinges, freedoms_of(21), body_compliance(stage)).stiffness)
    K = analyse(stage, mobility).stiffness
    return np.array([error_matrix(K, each, lever) for each in real])


def joint_command(stage: Stage, mobility: int, real: str = CALIBRATED) -> Array:
    """Error percentages (3, 3) when the independent rotations of (30) are imposed on a stage with all 21 freedoms.

    Notes
    -----
    The model turns the command into rotations of base (mobility three) or base and elbow hinges (six) by (29); the
    stage takes the pose of least energy with these rotations R phi_a given:
    `phi_a = K_aa^-1 R^T (R K_aa^-1 R^T)^-1 phi_given`, links rigid, hinges by the formula `real`.
    """
    of, metal = assemble(stage, mobility), assemble(stage, 21, real)
    known, at = stiffness(of), stiffness(metal)
    given = known.C_aa @ known.influence.G_u.T @ known.K_uu  # (29), (30)
    R = at.influence.G_a[np.searchsorted(metal.joints.slot, of.joints.slot[of.choice.independent])]
    phi = at.C_aa @ R.T @ np.linalg.solve(R @ at.C_aa @ R.T, given)
    return error_matrix(np.eye(3), at.influence.G_u @ phi, stage.chain.link_lengths[2])


def _row(name: str, mobility: int, percent: Array) -> Alternative:
    """`percent` (3, 3), column j for command j."""
    across = np.max(np.abs(percent - np.diag(np.diag(percent))), axis=0)
    return Alternative(name=name, mobility=mobility, along=Triple.of(np.diag(percent)), across=Triple.of(across))


def markdown_alternatives(found: list[Alternative]) -> str:
    """The alternatives as a Markdown table, per cent: along the command, and the largest across it."""
    head = ("alternative", "model", "X along", "across", "Y along", "across", "theta along", "across")
    rows = [
        (
            each.name,
            f"{each.mobility}",
            *(f"{getattr(p, axis):.3f}" for axis in DIRECTIONS for p in (each.along, each.across)),
        )
        for each in found
    ]
    return f"{markdown_table(head, rows, 'lrrrrrrr')}\n\n{INFERENCE}\n"
