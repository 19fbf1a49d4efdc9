"""What `flexfem design` prints of a record, and with which arguments and exit code."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from flexfem import designs
from flexfem.commands.design import print_design
from flexfem.synthesis.result import Designed

from .recorded import REQUIREMENTS, recorded, requirement


def printed(of: Designed, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Lines that are printed, blanks between columns made one."""
    print_design(of)
    return [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]


def test_a_record_is_printed_with_each_number_where_its_heading_says(capsys):
    assert printed(recorded(), capsys) == [
        "Recorded: meets not all requirements: the nearest that was found; seed 2003",
        "dimension designed without steps, model",
        "neck 0.505 0.5042",
        "l1 31.5 31.62 at an end of its range",
        "reach: 412 ± 1.2 um, the larger the better (finite elements; the model by itself 433)",
        "mass: 0.0893 kg, the smaller the better (exact; the model by itself 0.0871)",
        "requirement wanted value margin (%) 1 % more costs the objective checked by",
        "stiffness at least 60, at most 80 61.5 ± 0.25 N/mm 1.88 ± 0.31 met 0.47 % finite elements",
        "diameter at most 150 153 mm -2 missed not known analytic model alone",
        "coupling at most 0.0135 0.0131 ± 0.0009, of that 0.0007 by sampling 2.96 ± 6.7 within the band "
        "analytic model alone",
        "change (%) for 1 % more of reach mass stiffness diameter",
        "neck -1.310 +0.120 -2.430 +0.540",
        "l1 +0.650 +0.760 +1.870 +0.980",
        "relaxed least in all, diameter would be 153: 2 %",
        "relaxing stiffness: alone, to 57.4, 4.33 % (by the model)",
        "relaxing diameter: no relaxation of it alone is enough",
        "coupling_95 of 100,000 stages that no search has seen, by the model: 0.0136, 95 % interval 0.0132 to 0.0141; "
        "of the 500 searched 0.0121; finite elements of 20: 0.9632 times that, off by at most 0.00027 in one",
        "front: 2 designs that no other beats in all objectives, by finite elements",
        "neck l1 reach (um) mass (kg) margin of stiffness (%) margin of diameter (%) margin of coupling (%)",
        "1 0.43 36 405 0.081 3.1 -4.2 5.3",
        "2 0.52 30 466 0.093 6.4 -7.5 8.6",
        "evaluations: 53,345 by analytic, 12 by finite elements; 17 designs drawn",
        "largest difference of corrected model and finite elements, by round: 7.53, 0.066 %",
        "warning: life extrapolated",
        "1 of these numbers is assumed (1 of geometry and material): --json lists them",
    ]


def test_a_quantity_that_is_best_and_required_is_decisive_once():
    again = requirement("range_x_um", "least reach", value=412.0, uncorrected=433.0, at_least=400.0, size=400.0,
                        margin=12.0, margin_percent=3.0, active=True)  # fmt: skip
    found = recorded(requirements=[*REQUIREMENTS, again], front=[]).decisive
    assert [each.label for each in found] == ["reach", "mass", "stiffness", "diameter"]


def test_what_is_met_is_said_to_be_and_a_coupling_that_nothing_checks_has_no_factor(capsys):
    met = requirement("coupling_95", "coupling", value=0.01, uncorrected=0.01, at_most=0.02, size=0.02, margin=0.01,
                      margin_percent=50.0)  # fmt: skip
    unchecked = recorded().scattered[0].model_copy(update={"factor": None, "misfit": None, "checked_stages": 0})
    of = recorded(feasible=True, requirements=[*REQUIREMENTS[:2], met], scattered=[unchecked])
    lines = printed(of, capsys)
    assert lines[0] == "Recorded: meets all requirements; seed 2003"
    assert [line for line in lines if line.startswith("coupling_95")] == [
        "coupling_95 of 100,000 stages that no search has seen, by the model: 0.0136, 95 % interval 0.0132 to 0.0141; "
        "of the 500 searched 0.0121"
    ]


@pytest.mark.parametrize(("feasible", "agreed", "code"), [(True, True, 0), (True, False, 1), (False, True, 1)])
def test_the_command_ends_with_one_where_no_design_is_found_or_proven(flexfem, monkeypatch, feasible, agreed, code):
    def found(*asked):
        asked[-1]("told at once")
        return recorded(feasible=feasible, agreed=agreed)

    monkeypatch.setattr(designs, "design", found)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    ended, out, err = flexfem("design", "wanted.toml")
    assert ended == code and out.startswith("Recorded: ") and os.environ["OMP_NUM_THREADS"] == "1"
    assert err.endswith(" s\n") and "told at once" not in err  # where no terminal is, a line every ten seconds


def test_the_command_hands_on_its_options_and_prints_the_record_for_machines(flexfem, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(designs, "design", lambda *given: asked.append(given[:4]) or recorded())
    monkeypatch.setattr("flexfem.plot.write.write_design_figures", lambda found, stored: [stored])
    code, out, err = flexfem("design", "wanted.toml", "-o", tmp_path / "out", "--workers", "3", "--json")
    assert code == 1 and json.loads(out) == recorded().model_dump(mode="json")
    assert err.splitlines()[0] == str(tmp_path / "out/wanted-design.json")
    flexfem("design", "wanted.toml", "--scheduler", "tcp://cluster:1")
    assert asked == [
        (Path("wanted.toml"), tmp_path / "out", 3, None), (Path("wanted.toml"), None, 1, "tcp://cluster:1")
    ]  # fmt: skip
