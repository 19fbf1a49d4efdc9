"""The numbers behind the paper's claims, `examples/claims.py`, on a part of its ensemble."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[1] / "examples" / "claims.py"


@pytest.fixture(scope="module")
def script() -> Any:
    spec = importlib.util.spec_from_file_location("claims", SCRIPT)
    assert spec is not None and spec.loader is not None
    sys.modules["claims"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def ensemble(script: Any) -> Any:
    return script.draw_ensemble(60)


MEANS = {  # per cent, of the pairs among the first 60 that can be made
}


def test_print(script, ensemble):
    print(len(ensemble.pairs.six.stages), ensemble.infeasible, ensemble.off_chart)
    for claim in script.CLAIMS:
        v = claim.values(ensemble.pairs)
        print(claim.id, np.nanmean(v), int(np.sum(claim.holds(v))))
