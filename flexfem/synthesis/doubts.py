"""What to know of the answers of a design: formulas and lives out of their range, stacks that drift leaves out."""

from __future__ import annotations

from collections.abc import Mapping

from flexfem.arrays import Array
from flexfem.hinges.strength import required_law
from flexfem.study.answer import doubted
from flexfem.study.columns import LIFE_AMPLITUDES, row_of
from flexfem.synthesis.requirements import LoadedRequirements
from flexfem.units import unit_of


def doubts_of(loaded: LoadedRequirements, values: Array, columns: Mapping[str, float]) -> list[str]:
    """What a study says of a design (d,) whose columns these are, and where the amplitudes for a life are none."""
    row = row_of("ok", "", [columns[name] for name in loaded.study.outputs])
    said = str(doubted(loaded.study, values[None], row).reason[0])
    return [*(said.split("; ") if said else ()), *_of_amplitudes(loaded, columns)]


def _of_amplitudes(loaded: LoadedRequirements, columns: Mapping[str, float]) -> list[str]:
    """Whether the amplitudes for the wanted life are where Basquin's law was not fitted, or beyond yield."""
    of = loaded.requirements.life
    asked = [name for name in LIFE_AMPLITUDES if name in columns and name in loaded.requirements.asked]
    if of is None or not asked:
        return []
    low, high = required_law(loaded.stage.material).range
    said = []
    if not low <= of.cycles <= high:
        said.append(
            f"amplitudes for {of.cycles:g} cycles extrapolated, outside the {low:g} to {high:g} cycles of Basquin's law"
        )
    own = abs(of.amplitude[LIFE_AMPLITUDES.index(asked[0])]) * unit_of(asked[0]).factor
    if columns["safety_factor"] * own < columns[asked[0]]:  # mean and amplitude grow together
        said.append(f"amplitudes for {of.cycles:g} cycles by elastic stress, beyond yield")
    return said
