"""Natural frequencies of the pseudo-rigid model: links and platform with the mass and inertia of their outlines.

Seven bodies move, with three freedoms each: the platform and two links a chain. The flexibility method of `drive` gives
the compliance C (21, 21) of their twists under wrenches on them, whatever freedoms the hinges have; its rank is the
mobility. With their mass matrix M, the eigenvalues of `C M` are `1 / omega^2`. Every body is drawn up to the narrowest
section of its hinges: half a notch moves with either side, that of the pad rests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexfem.analytic.drive import LinkParts, driven, link_parts
from flexfem.analytic.kinematics import Freedoms, mobility
from flexfem.analytic.model import AnalyticResult
from flexfem.analytic.notch import Compliance
from flexfem.arrays import Array
from flexfem.stage.bodies import BODIES, centrelines
from flexfem.stage.contacts import LINKS, Push, Stack, Station
from flexfem.stage.designs import Frames, chain_rotation, stage_frames
from flexfem.stage.inertia import Payload, body_moments, hub_moments, inertia_of, mass_per_area, payload_matrix
from flexfem.stage.schema import CHAINS, Stage

PLATFORM = BODIES.index("platform")
ON_BODIES = 6 * len(CHAINS)  # twists of links
FREEDOMS = 3 + ON_BODIES  # and of the platform


class Dynamics(NamedTuple):
    """Of n designs, or one without an axis: bodies in the order platform, then link 1 and link 2 of every chain.

    compliance, mass : (..., 21, 21), of the bodies' twists x, y, theta at the platform centre: mm, rad, N, tonne.
    rank : of the compliance, the mobility; its other eigenvalues are round-off.
    """

    compliance: Array
    mass: Array
    rank: int

    @property
    def frequencies(self) -> Array:
        """Natural frequencies (..., 21), rad/s, rising; inf for freedoms that the hinges do not have, nan for a design
        without an answer."""
        L = np.linalg.cholesky(self.mass)
        A = np.swapaxes(L, -1, -2) @ self.compliance @ L
        bad = ~np.all(np.isfinite(A), axis=(-2, -1), keepdims=True)
        values = np.linalg.eigvalsh(np.where(bad, 0.0, (A + np.swapaxes(A, -1, -2)) / 2))[..., ::-1]
        held = (np.arange(FREEDOMS) >= self.rank) | (values <= 0)
        found = np.where(held, np.inf, 1 / np.sqrt(np.where(held, 1.0, values)))
        return np.where(bad[..., 0], np.nan, found)


def dynamics(stage: Stage, of: AnalyticResult, payload: Payload, stacks: tuple[Stack, ...] = ()) -> Dynamics:
    """The dynamics of one stage by the hinges, freedoms and links of an analytic model.

    Parameters
    ----------
    stacks : engaged ones, whose openings (n) are added to the compliance, for `engaged`.
    """
    pushes = (*on_bodies(stage if of.links else None), *stacks)
    elastic = link_parts(stage, pushes) if of.links else None
    C = driven(stage_frames(stage), of.hinges, of.freedoms, pushes, elastic).compliance
    M = mass_matrix(body_moments(stage), hub_moments(stage), np.asarray(mass_per_area(stage)), payload)
    return Dynamics(C, M, FREEDOMS if of.links else of.mobility)


def engaged(of: Dynamics, rates: Array) -> Dynamics:
    """With stacks of stiffness (n,), N/mm, in the openings at the end of its compliance (21 + n, 21 + n)."""
    C, root = of.compliance, np.sqrt(rates)
    bodies, across, openings = C[:FREEDOMS, :FREEDOMS], C[:FREEDOMS, FREEDOMS:], C[FREEDOMS:, FREEDOMS:]
    Y = root[:, None] * np.linalg.inv(np.eye(len(root)) + root[:, None] * openings * root) * root
    return of._replace(compliance=bodies - across @ Y @ across.T)


def many(
    frames: Frames, hinges: Compliance, freedoms: Freedoms, mass: Array, elastic: LinkParts | None = None
) -> Dynamics:
    """The dynamics of n designs; hinges (n, 3, 3), mass (n, 21, 21) of `mass_matrix`.

    elastic : (n, ...) each, of `elastic_bodies`; None where links are rigid.
    """
    rank = mobility(freedoms) if elastic is None else FREEDOMS
    return Dynamics(driven(frames, hinges, freedoms, on_bodies(), elastic).compliance, mass, rank)


def elastic_bodies(stage: Stage) -> LinkParts:
    """What elastic links add to the compliances of one stage, for the wrenches of `on_bodies`. Raises BadInput."""
    return link_parts(stage, on_bodies(stage))


def mass_matrix(bodies: Array, hub: Array, areal: Array, payload: Payload) -> Array:
    """Mass matrix (..., 21, 21) of the moving bodies, about the platform centre.

    Parameters
    ----------
    bodies : (..., 3 chains, 4 bodies, 4) of `inertia.body_moments`.   hub : (..., 4).   areal : (...), tonne/mm^2.
    """
    platform = inertia_of(bodies[..., PLATFORM, :].sum(axis=-2) + hub, areal).matrix + payload_matrix(payload)
    links = inertia_of(bodies, np.asarray(areal)[..., None, None]).matrix
    M = np.zeros((*platform.shape[:-2], FREEDOMS, FREEDOMS))
    M[..., :3, :3] = platform
    for k, (chain, link) in enumerate((chain, link) for chain in range(len(CHAINS)) for link in LINKS):
        at = slice(3 + 3 * k, 6 + 3 * k)
        M[..., at, at] = links[..., chain, link, :, :]
    return M


def on_bodies(stage: Stage | None = None) -> tuple[Stack, ...]:
    """Unit wrenches on the links as pushes: x, y, theta of link 1 and link 2 of every chain, in the stage's frame.

    stage : to spread them over the middle of elastic links; None where links are rigid.
    """
    found = []
    for chain in range(len(CHAINS)):
        for link in LINKS:
            place = None if stage is None else _whole(stage, chain + 1, link)
            for wrench in np.eye(3) @ chain_rotation(chain):  # rows: the stage's directions in the chain's frame
                push = Push(link, wrench, place)
                found.append(Stack(chain, (push, Push(0, np.zeros(3), None))))
    return tuple(found)


def _whole(stage: Stage, chain: int, link: int) -> Station:
    """The station that is a whole link: inertia acts all along it."""
    path = centrelines(stage, chain)[link]
    length = sum(segment.length for segment in path)
    return Station(path, stage.chain.link_width, length / 2, length / 2)
