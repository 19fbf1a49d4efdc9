"""What decides the numbers of a study is what its answers run, and of that what Python reads."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from flexfem.study.versions import counts, digest

ROOT = Path(__file__).parents[2]
SOURCES = {
    "study/answer.py": '''"""Prose."""\nfrom flexfem.stage import schema\n\ndef answer(x):
    """Prose of a function."""
    from flexfem.fem.mesh import mesh
    return mesh(x)  # a comment\n''',
    "study/content.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from flexfem.plot.style import INK\n",
    "fem/mesh.py": "def mesh(x, size=4.0):\n    start('flexfem.fem.mesher')\n    return 2.5 * x + size\n",
    "fem/mesher.py": "LIMIT = 3\n",
    "stage/__init__.py": "",
    "mechanism/stage.py": "SMALLEST = 1e-6\n",
    "verify/alternatives.py": "ACROSS = 8\n",
    "plot/style.py": "INK = 1\n",
    "data/chart.json": "[1.0]\n",
    "data/materials.toml": "[metal]\ndensity_kg_m3 = 1\n",
}
ALIKE = [
    ("study/answer.py", "Prose.", "Other prose, of\n\nother length."),
    ("study/answer.py", "Prose of a function", "More prose"),
    ("study/answer.py", "# a comment", ""),
    ("study/answer.py", "    return", "\n    # why\n    return"),
    ("verify/alternatives.py", "8", "9"),
    ("plot/style.py", "1", "2"),
    ("data/materials.toml", "1", "2"),  # counts in the hash of a stage
]
OTHER = [
    ("study/answer.py", "mesh(x)", "mesh(-x)"),
    ("fem/mesh.py", "2.5", "2.6"),
    ("fem/mesh.py", "+", "-"),
    ("fem/mesh.py", "4.0", "5.0"),
    ("fem/mesher.py", "3", "4"),
    ("mechanism/stage.py", "1e-6", "1e-7"),
    ("stage/__init__.py", "", "x = 1"),
    ("data/chart.json", "1.0", "1.1"),
]


@pytest.mark.parametrize(("edits", "same"), [(ALIKE, True), (OTHER, False)], ids=["prose", "numbers"])
def test_an_edit_counts_when_it_can_change_a_number(
    edits: list[tuple[str, str, str]], same: bool, tmp_path: Path
) -> None:
    for number, edit in enumerate([None, *edits]):
        for name, content in SOURCES.items():
            path = tmp_path / str(number) / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content.replace(*edit[1:], 1) if edit is not None and edit[0] == name else content)
            assert edit is None or edit[0] != name or edit[1] in content
    before = digest(tmp_path / "0")
    for number, edit in enumerate(edits, 1):
        assert (digest(tmp_path / str(number)) == before) is same, edit


def test_what_an_answer_loads_counts_and_what_shows_it_does_not() -> None:
    """Asked of Python, in a process that answers by both models: no route through the text of imports."""
    script = (
        "import sys; from flexfem.study.loaded import load_study; from flexfem.study.answer import answer\n"
        "for path in sys.argv[1:]: assert answer(load_study(path), 0, 1, True).status[0] == 'ok'\n"
        "print(*(m.__file__ for n, m in sys.modules.items() if n.startswith('flexfem.')))"
    )
    studies = [ROOT / "tests/baselines/studies" / f"{name}-study.toml" for name in ("analytic", "element")]
    command = [sys.executable, "-c", script, *map(str, studies)]
    loaded = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, timeout=60).stdout.split()
    paths = {Path(each).relative_to(ROOT / "flexfem").as_posix() for each in loaded}
    assert {"fem/factor.py", "hinges/formulas.py", "study/sampling.py"} <= paths
    assert {path for path in paths if not counts(path)} == set()
    for path in ("commands/cli.py", "plot/style.py", "study/run.py", "verify/alternatives.py"):
        assert (ROOT / "flexfem" / path).exists() and not counts(path), path
    assert counts("data/hinge_chart.json") and counts("fem/mesher.py") and counts("study/parts.py")
    assert counts("study/content.py") and counts("verify/questions.py")
