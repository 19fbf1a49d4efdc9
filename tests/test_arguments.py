"""What the Python API is given wrongly is refused in one line, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest

import flexfem

ROOT = Path(__file__).parents[1]
FIXTURE = ROOT / "cases" / "fixture.toml"
STUDY = ROOT / "cases" / "study-reach.toml"
NAN, INF = float("nan"), float("inf")
BAD = [
    (lambda s, f: flexfem.under_load(s, force=[NAN, 0, 0], vtu=f), "force: expected finite"),
    (lambda s, f: flexfem.under_load(s, displacement=[INF, 0, 0], vtu=f), "displacement: expected finite"),
    (lambda s, f: flexfem.under_load(s, force=[1, 2]), r"force of shape \(2,\)"),
    (lambda s, f: flexfem.under_load(s, force="abc"), "force: expected numbers"),
    (lambda s, f: flexfem.under_load(s, force=[2e9, 0, 0]), r"within ±1e\+09"),
    (lambda s, f: flexfem.under_load(s, vtu=3), "3, expected the path"),
    (lambda s, f: flexfem.mesh(s, f, resolution=-1), "resolution -1, expected an integer from 2"),
    (lambda s, f: flexfem.mesh(s, None), "None, expected the path"),
    (lambda s, f: flexfem.summary(s, elements=True, resolution=2.5), "resolution 2.5"),
    (lambda s, f: flexfem.summary(s, formula=""), "hinge formula '' is not known"),
    (lambda s, f: flexfem.solve(s, 65), "resolution 65, expected an integer from 2 to 64"),
    (lambda s, f: flexfem.errors(s, resolution=3), "resolution 3, expected an integer from 4"),
    (lambda s, f: flexfem.budget(s, resolution=0), "resolution 0, expected an integer from 4"),
    (lambda s, f: flexfem.budget(s, {"q": 1.0}), "amplitudes {'q': 1.0}, expected numbers by name: x, y, theta"),
    (lambda s, f: flexfem.budget(s, {"y": NAN}), "amplitudes y nan"),
    (lambda s, f: flexfem.budget(s, [1, 2, 3]), "amplitudes .* by name"),
    (lambda s, f: flexfem.large(s, amplitude=0), "amplitude 0, expected a number above 0"),
    (lambda s, f: flexfem.large(s, amplitude="x"), "amplitude 'x'"),
    (lambda s, f: flexfem.large(s, resolution="8"), "resolution '8'"),
    (lambda s, f: flexfem.reach(s, load=[1, 2]), r"load of shape \(2,\)"),
    (lambda s, f: flexfem.reach(s, [0, 0, 2e6]), r"load: expected numbers within ±1e\+06"),
    (lambda s, f: flexfem.reach(s, mobility=4), "mobility"),
    (lambda s, f: flexfem.reach(s, formula="none"), "none"),
    (lambda s, f: flexfem.reach(s, resolution=1), "resolution 1"),
    (lambda s, f: flexfem.reach(s.replace(actuator=[])), r"no \[\[actuator"),
    (lambda s, f: flexfem.converge(s, [2, 3.5, 5]), "resolution 3.5"),
    (lambda s, f: flexfem.converge(s, []), "expected three or more"),
    (lambda s, f: flexfem.converge(s, 8), "resolutions 8"),
    (lambda s, f: flexfem.drive(s, pose=[1e300, 0, 0]), "pose: expected numbers within ±100"),
    (lambda s, f: flexfem.drive(s, pose=[0, 0, 0], load=[0, 0, 2e6]), r"load: expected numbers within ±1e\+06"),
    (lambda s, f: flexfem.drive(s, pose=[0, 0, 0], resolution=1), "resolution 1"),
    (lambda s, f: flexfem.drift(s, resolution=3), "resolution 3, expected an integer from 4"),
    (lambda s, f: flexfem.drift(s, resolution=5, layers=3), "resolution 5, expected an integer from 6"),
    (lambda s, f: flexfem.drift(s, layers=2), "layers 2, expected an integer from 3 to 16"),
    (lambda s, f: flexfem.drift(s.replace(material={"name": "own", "expansion": None})), "is missing"),
    (lambda s, f: flexfem.drift(s, analytic=flexfem.Analytic(mobility=4)), "mobility"),
    (lambda s, f: flexfem.drift(s, analytic=flexfem.Analytic(formula="none")), "hinge formula 'none' is not known"),
    (lambda s, f: flexfem.drift(s, analytic=flexfem.Analytic(6, links=True)), "elastic links"),
    (lambda s, f: flexfem.drift("geometry/mobility6.toml"), "expected a flexfem.Stage"),
    (
        lambda s, f: flexfem.drift(s.replace(material={"name": "own", "expansion": None})),
        r"material.expansion_um_per_m_k is missing, expected um/\(m K\)",
    ),
    (lambda s, f: flexfem.modes(s, 0), "count 0, expected an integer from 1 to 100"),
    (lambda s, f: flexfem.modes(s, 2.0), "count 2.0"),
    (lambda s, f: flexfem.modes(s, payload=3), "payload 3, expected two numbers: mass"),
    (lambda s, f: flexfem.modes(s, payload=(-1, 0)), "payload -1 0, expected two numbers from 0 to 10000"),
    (lambda s, f: flexfem.modes(s, payload=(1, NAN)), "payload 1 nan, expected"),
    (lambda s, f: flexfem.modes(s, drives="on"), "drives 'on', expected disengaged or engaged"),
    (lambda s, f: flexfem.modes(s, resolution=3), "resolution 3, expected an integer from 4"),
    (lambda s, f: flexfem.modes_solid(s, 41), "count 41, expected an integer from 1 to 40"),
    (lambda s, f: flexfem.modes_solid(s, payload=(1, NAN)), "payload 1 nan, expected"),
    (lambda s, f: flexfem.modes_solid(s, payload=(1, 8), tilting=3.9), "tilting 3.9, expected a number from 4 to"),
    (lambda s, f: flexfem.modes_solid(s, tilting=NAN), "tilting nan, expected a number from 0 to"),
    (lambda s, f: flexfem.modes_solid(s, tilting="flat"), "tilting 'flat'"),
    (lambda s, f: flexfem.modes_solid(s, resolution=3), "resolution 3, expected an integer from 4"),
    (lambda s, f: flexfem.vibration_solid(s, layers=2), "layers 2, expected an integer from 3 to 16"),
    (lambda s, f: flexfem.modes(s.replace(actuator=[]), drives="engaged"), r"no \[\[actuator\]\]: the stage has no"),
    (lambda s, f: flexfem.experiment(s, None), "None, expected the path"),
    (lambda s, f: flexfem.experiment(s, FIXTURE, resolution=1), "resolution 1"),
    (lambda s, f: flexfem.experiment(s, FIXTURE, measured=3), "3, expected the path"),
    (lambda s, f: flexfem.experiment(s, FIXTURE, formula=""), "hinge formula '' is not known"),
    (lambda s, f: flexfem.experiment(s, FIXTURE, mobility=6, links=True, resolution=None), "elastic links"),
    (lambda s, f: flexfem.identify(s, None), "None, expected the path"),
    (lambda s, f: flexfem.identify(s, FIXTURE, unknown="bar"), "unknown 'bar', expected pole or springs"),
    (lambda s, f: flexfem.identify(s, FIXTURE, confidence=NAN), "confidence nan"),
    (lambda s, f: flexfem.identify(s, FIXTURE, confidence=0.95), "confidence 0.95, expected a number from 50"),
    (lambda s, f: flexfem.as_built(s, 3), "3, expected the path"),
    (lambda s, f: flexfem.as_built(s, FIXTURE, formula="x"), "hinge formula 'x' is not known"),
    (lambda s, f: flexfem.as_built(s, FIXTURE), "this is a fixture file, expected a necks file"),
    (lambda s, f: flexfem.export(s, 3), "3, expected the path"),
    (lambda s, f: flexfem.export(None, f.with_suffix(".dxf")), "None, expected a flexfem.Stage"),
    (lambda s, f: flexfem.export(s, f), "extension '.vtu', expected a file name"),
    (lambda s, f: flexfem.export(s, f.with_suffix(".svg"), kerf=INF), "kerf inf, expected a number from 0.01 to 10 mm"),
    (lambda s, f: flexfem.view(None), "None, expected the path"),
    (lambda s, f: flexfem.view(FIXTURE, 3), "3, expected the path"),
    (lambda s, f: flexfem.new_stage(None), "None, expected the path"),
    (lambda s, f: flexfem.new_stage(f), "expected a file name that ends in .toml"),
    (lambda s, f: flexfem.analyse(s, mobility=[6]), r"mobility = \[6\]"),
    (lambda s, f: flexfem.analyse(s, formula=["x"]), "hinge formula"),
    (lambda s, f: flexfem.analyse("geometry/mobility6.toml"), "expected a flexfem.Stage"),
    (lambda s, f: flexfem.check(None), "None, expected a flexfem.Stage"),
    (lambda s, f: flexfem.load(None), "None, expected the path"),
    (lambda s, f: flexfem.hinge_review(0.5), "height 0.5, expected a number from 1 to"),
    (lambda s, f: flexfem.hinge_review("x"), "height 'x'"),
    (lambda s, f: flexfem.hinge_review(poissons_ratio=0.7), "poissons_ratio 0.7, expected a number from 0 to 0.5"),
    (lambda s, f: flexfem.thickness_review(NAN), "poissons_ratio nan, expected a number from 0.1 to 0.45"),
    (lambda s, f: flexfem.thickness_review(0.46), "poissons_ratio 0.46"),
    (lambda s, f: flexfem.load(b"a.toml"), "expected the path"),
    (lambda s, f: flexfem.verification(3), "3, expected the path"),
    (lambda s, f: flexfem.run_study(None), "None, expected the path"),
    *(
        (lambda s, f, n=n: flexfem.run_study(STUDY, f.parent, n), f"workers {n!r}, expected an integer from 1 to 1024")
        for n in (0, -1, 2.5, NAN, True, "2")
    ),
    (lambda s, f: flexfem.run_study(STUDY, f.parent, scheduler=3), "scheduler 3, expected its address"),
    (lambda s, f: flexfem.run_study(STUDY, f.parent, shard=1), "--shard 1, expected I/N"),
    (lambda s, f: flexfem.run_study(STUDY, 3), "3, expected the path"),
    (lambda s, f: flexfem.analyse(s).force([1e308] * 3), r"pose: expected numbers within ±10000"),
    (lambda s, f: flexfem.analyse(s).pose([0, 0, 1e308]), r"force: expected numbers within ±1e\+09"),
    (lambda s, f: flexfem.analyse(s).neck_stress([[0, 2e4, 0]]), "pose: expected numbers within"),
    (lambda s, f: flexfem.solve(s, 2).force([1e308] * 3), "pose: expected numbers within"),
    (lambda s, f: flexfem.solve(s, 2).pose([1e308] * 3), "force: expected numbers within"),
    (lambda s, f: flexfem.solve(s, 2).displacement([1e308] * 3), "force: expected numbers within"),
    (lambda s, f: flexfem.solve(s, 2).stress([1e308] * 3), "force: expected numbers within"),
    (lambda s, f: flexfem.solve(s, 2).neck_stress([1e308] * 3), "pose: expected numbers within"),
    (lambda s, f: flexfem.solve(s, 2).plot([1e308] * 3), "force: expected numbers within"),
    (lambda s, f: flexfem.schema_of([]), r"format \[\] is not known"),
    (lambda s, f: flexfem.report(3, f.with_suffix(".html")), "3, expected the path"),
    (lambda s, f: flexfem.report(FIXTURE, f.with_suffix(".html"), "life"), "sections 'life', expected a list of"),
    (lambda s, f: flexfem.study.table(3), "3, expected the path"),
]


def test_a_wrong_argument_is_refused_in_one_line_and_nothing_is_written(tmp_path):
    stage, target = flexfem.load(ROOT / "geometry" / "mobility6.toml"), tmp_path / "a.vtu"
    for ask, said in BAD:
        with pytest.raises(flexfem.BadInput, match=said) as refused:
            ask(stage, target)
        assert "\n" not in str(refused.value), said
    assert list(tmp_path.iterdir()) == []


def test_amplitudes_that_are_not_given_keep_their_default(monkeypatch):
    monkeypatch.setattr("flexfem.verify.budget.budget", lambda stage, amplitudes, *_: amplitudes)
    stage = flexfem.load(ROOT / "geometry" / "mobility6.toml")
    assert flexfem.budget(stage, {"x": 0.1}, three_dimensional=False) == {"x": 0.1, "y": 0.05, "theta": 0.001}
