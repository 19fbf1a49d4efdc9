"""The live page: what it is asked and what it answers, over the protocol that a browser uses."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest

import flexfem
from flexfem.importing.drawings import NO_READING
from flexfem.live.answers import drawing_of, rows_by_model
from flexfem.live.numbers import save, sliders_of
from flexfem.live.server import LivePage
from flexfem.live.session import Session

testclient = pytest.importorskip("starlette.testclient", reason="needs flexfem[live]")

PARALLELOGRAM = Path("geometry/parallelogram.toml")
PORT = 4321
OWN = f"http://127.0.0.1:{PORT}"
CUBE = 1e-2  # of a cube law: shear, fillets and the width of the leaves change it little


@pytest.fixture
def file(tmp_path):
    copy = tmp_path / "mine.toml"
    copy.write_text(PARALLELOGRAM.read_text())
    return copy


@pytest.fixture
def page(file, monkeypatch):
    """A page whose finite elements are never asked."""

    async def asked(*_):
        await asyncio.sleep(0)

    monkeypatch.setattr("flexfem.live.elements.Elements.answer", asked)
    page = LivePage(Session(file, NO_READING))
    page.port = PORT
    return page


def client_of(page, **headers):
    client = testclient.TestClient(page.application(), base_url=OWN)
    client.headers.update(headers)
    return client


def stiffness_along_x(session):
    return float(session.answer.rows[0].cells[0].split()[0])


def test_the_stiffness_of_leaves_follows_the_cube_of_their_thickness(page):
    session = page.session
    before = stiffness_along_x(session)
    with client_of(page) as client:
        answer = client.post(
            f"/{page.token}/change", content=json.dumps({"parameters.neck_mm": 0.6})
        )
    assert answer.status_code == 200
    assert session.fault is None
    assert stiffness_along_x(session) / before == pytest.approx(1.2**3, rel=CUBE)
    assert session.stored.parameters["neck_mm"] == 0.5


def test_numbers_that_cannot_be_made_are_refused_and_the_last_answer_stays(page):
    session = page.session
    before = session.answer
    with client_of(page) as client:
        client.post(f"/{page.token}/change", content=json.dumps({"parameters.neck_mm": -1.0}))
        assert "neck" in session.fault.text
        assert session.answer is before
        refused = ["wide", "NaN", "1e999", "Infinity"]
        bodies = [f'{{"parameters.neck_mm": {value}}}' for value in refused]
        for body in ("[]", "{", *bodies, "1" * 100_000):
            assert client.post(f"/{page.token}/change", content=body).status_code == 400
        client.post(f"/{page.token}/change", content=json.dumps({"parameters.nek_mm": 1.0}))
    assert "parameters.nek_mm is no number of this file" in session.fault.text


def test_a_fault_in_the_file_is_shown_at_its_line_until_it_is_mended(page, file):
    session = page.session
    before = session.answer
    text = file.read_text()
    file.write_text(text.replace('length_mm = "length"', 'length_mm = "lenth"'))
    session.reload()
    line = 1 + text.splitlines().index('length_mm = "length"')
    assert session.fault.line == line
    assert dict(session.fault.lines)[line] == 'length_mm = "lenth"'
    assert session.answer is before
    file.write_text(text)
    session.reload()
    assert session.fault is None


def test_a_slider_does_not_hide_a_fault_in_the_file(page, file):
    session = page.session
    text = file.read_text()
    file.write_text(text.replace('length_mm = "length"', 'length_mm = "lenth"'))
    session.reload()
    fault = session.fault
    session.change({"parameters.neck_mm": 0.6})
    assert session.fault is fault
    file.write_text(text)
    session.reload()
    assert session.fault is None


def test_what_an_editor_writes_stays_and_a_moved_slider_stays_moved(page, file):
    """The editor changes another number and a comment, and Save is pressed before it is noticed."""
    session = page.session
    session.change({"parameters.neck_mm": 0.6})
    text = file.read_text().replace("length_mm = 50 ", "length_mm = 45 ", 1) + "# noted\n"
    file.write_text(text)
    with client_of(page) as client:
        answer = client.post(f"/{page.token}/save")
    assert answer.json() == {"written": ["parameters.neck_mm"]}
    assert file.read_text() == text.replace("neck_mm = 0.5", "neck_mm = 0.6", 1)
    assert session.answer.values["parameters.length_mm"] == 45.0


def test_a_number_that_the_editor_changes_is_that_of_the_file(page, file):
    session = page.session
    session.change({"parameters.neck_mm": 0.6, "parameters.length_mm": 55.0})
    file.write_text(file.read_text().replace("neck_mm = 0.5", "neck_mm = 0.4", 1))
    session.reload()
    assert session.asked["parameters.neck_mm"] == 0.4
    assert session.moved == {"parameters.length_mm": 55.0}


def test_nothing_is_saved_while_the_file_or_the_numbers_are_wrong(page, file):
    session = page.session
    text = file.read_text()
    session.change({"parameters.neck_mm": 90.0})
    assert session.fault.text.startswith("neck 90 mm: body.ground: is in 2 pieces")
    with client_of(page) as client:
        assert client.post(f"/{page.token}/save").status_code == 400
        assert file.read_text() == text
        session.change({"parameters.neck_mm": 0.6})
        file.unlink()
        session.reload()
        assert "no such file" in session.fault.text
        assert client.post(f"/{page.token}/save").status_code == 400
    assert not file.exists()
    file.write_text(text)
    session.reload()
    assert session.fault is None and session.moved == {"parameters.neck_mm": 0.6}


def test_ends_of_lines_a_link_and_the_rights_of_a_file_stay(tmp_path, file):
    text = file.read_text().replace("\n", "\r\n").encode()
    file.write_bytes(text)
    file.chmod(0o640)
    link = tmp_path / "link.toml"
    link.symlink_to(file)
    assert save(link, {"parameters.neck_mm": 0.6}) == ["parameters.neck_mm"]
    assert file.read_bytes() == text.replace(b"neck_mm = 0.5", b"neck_mm = 0.6", 1)
    assert link.is_symlink() and file.stat().st_mode & 0o777 == 0o640


WITHOUT_PARAMETERS = """
name = "lever"
thickness_mm = 8
material = { name = "al-7075-t6" }
body = [
    { name = "frame", fixed = true, outline_mm = [[-10, -20], [10, -20], [10, 0], [-10, 0]] },
    { name = "stage", outline_mm = [[-10, 30], [10, 30], [10, 40], [-10, 40]] },
]
output = { body = "stage", at_mm = [0, 35] }
[[hinge]]
name = "leaf"
between = ["frame", "stage"]
at_mm = [0, 15]
direction_deg = 90
shape = "leaf"
length_mm = 30
neck_mm = 0.5
"""


def test_numbers_that_the_file_does_not_state_have_no_slider(file):
    """Those of a registered material could not be saved."""
    file.write_text(WITHOUT_PARAMETERS)
    assert [slider.path for slider in Session(file, NO_READING).sliders] == ["thickness_mm"]


def test_a_stage_file_is_answered(tmp_path):
    copy = tmp_path / "stage.toml"
    copy.write_text(Path("geometry/mobility6.toml").read_text())
    session = Session(copy, NO_READING)
    assert session.answer.handled is None
    assert stiffness_along_x(session) == pytest.approx(41.9, abs=0.1)


def test_save_changes_the_number_and_nothing_else_in_the_file(page, file):
    text = file.read_text()
    with client_of(page) as client:
        client.post(f"/{page.token}/change", content=json.dumps({"parameters.length_mm": 47.5}))
        answer = client.post(f"/{page.token}/save")
    assert answer.json() == {"written": ["parameters.length_mm"]}
    assert file.read_text() == text.replace("length_mm = 50 ", "length_mm = 47.5 ", 1)
    assert flexfem.load(file).parameters["length_mm"] == 47.5


def test_elements_of_arrays_are_saved_in_their_place(tmp_path):
    copy = tmp_path / "stage.toml"
    text = Path("geometry/mobility6.toml").read_text()
    copy.write_text(text)
    assert save(copy, {"chain.link_lengths_mm[1]": 33.0, "hinges.elbow.radius_mm": 1.5}) == [
        "chain.link_lengths_mm[1]"
    ]
    assert flexfem.load(copy).chain.link_lengths == (30.0, 33.0, 24.0)
    changed = [
        (old, new)
        for old, new in zip(text.splitlines(), copy.read_text().splitlines(), strict=True)
        if old != new
    ]
    assert len(changed) == 1


def test_only_the_page_itself_is_answered(page):
    with client_of(page) as client:
        assert client.get(f"/{page.token}/").status_code == 200
        assert client.get("/").status_code == 404
        assert client.get("/wrong/").status_code == 404
    for headers in ({"host": "evil.example:4321"}, {"origin": "http://evil.example"}):
        with client_of(page, **headers) as client:
            assert client.get(f"/{page.token}/").status_code == 404
            assert client.post(f"/{page.token}/save").status_code == 404


def test_sliders_are_the_parameters_that_are_numbers():
    sliders = sliders_of(flexfem.load(PARALLELOGRAM))
    assert [slider.name for slider in sliders] == ["length", "distance", "neck", "width", "stack"]
    assert (sliders[2].unit, sliders[2].value, sliders[2].low) == ("mm", 0.5, 0.25)
    of_stage = {
        slider.path: slider for slider in sliders_of(flexfem.load("geometry/mobility6.toml"))
    }
    assert of_stage["hinges.base.neck_mm"].value == 0.5
    assert of_stage["chain.joint_angles_deg[1]"].value == -90.0


def test_a_drawing_has_every_part_and_the_rows_have_a_cell_for_each_direction():
    mechanism = flexfem.load(PARALLELOGRAM)
    drawing = drawing_of(mechanism.layout)
    assert (len(drawing.ground), len(drawing.bodies), len(drawing.hinges)) == (1, 1, 2)
    assert drawing.output == [0.0, 55.0]
    assert drawing.actuators == [[-45.0, 55.0, -25.0, 55.0]]
    assert drawing.box[0] < -55 < 25 < drawing.box[0] + drawing.box[2]
    rows = rows_by_model(mechanism, "analytic")
    assert [len(row.cells) for row in rows] == [3, 3, 3, 3, 1, 1]


def test_a_port_that_is_taken_is_refused_in_one_line(file):
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(flexfem.BadInput, match=f"port {port}: .*expected a free port"):
            flexfem.serve(file, port=port, no_browser=True)
