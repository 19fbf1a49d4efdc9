# flexfem: `make` installs flexfem, and `make help` lists the targets. All commands run in .venv. It is created if it is missing.

PYTHON ?= python3
BIN := .venv/bin
FLEXFEM := $(BIN)/flexfem
SETUP := .venv/installed
TEST_SETUP := .venv/installed-for-tests
DOCS_SETUP := .venv/installed-for-docs

CASES := $(wildcard cases/fig*.toml)
RESULTS := $(CASES:cases/%.toml=reports/%.json)
STAGES := $(wildcard geometry/*.toml)
JOINTS := $(wildcard cases/joints-*.toml)
ACCEPTED := $(CASES) $(JOINTS) $(STAGES) $(wildcard tests/baselines/studies/*.toml) $(wildcard tests/baselines/mechanisms/*.toml)
PLOT_CODE := $(wildcard flexfem/plot/*.py)
OTHER_CODE := $(wildcard flexfem/study/*.py flexfem/commands/*.py)
MODEL_CODE := $(filter-out $(PLOT_CODE) $(OTHER_CODE),$(wildcard flexfem/*.py flexfem/*/*.py flexfem/*/*/*.py))

.PHONY: install help reproduce-figures full-report test test-slow test-all check docs claims validation baselines regression studies designs chart bench clean
.DELETE_ON_ERROR:

install: $(SETUP) ## install flexfem and its dependencies into .venv (default)
	@echo "flexfem is installed; next:"
	@echo "    source .venv/bin/activate"
	@echo "    flexfem --help"
	@echo "    flexfem summary geometry/mobility6.toml"
	@echo "make help lists what else make does"

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 22

reproduce-figures: reports/verification.md ## draw Figures 5 to 7 and the stages, into reports/
	@echo "figures: reports/fig5.png, reports/fig6.png, reports/fig7.png (and .pdf); all of them: reports/verification.md"

reports/verification.md: $(RESULTS) $(PLOT_CODE)
	@echo "drawing"
	@$(FLEXFEM) plot $(RESULTS) --output reports >/dev/null

$(RESULTS) &: $(CASES) $(STAGES) $(MODEL_CODE) $(SETUP) # one command for all cases: it solves each stage once
	@$(FLEXFEM) verify $(CASES) --output reports

full-report: reproduce-figures ## run reproduce-figures, and report commanded joints, error budgets, large displacements, mesh studies, hinge formulas and the paper's claims
	@$(FLEXFEM) verify $(JOINTS) --output reports/joints && \
	    $(FLEXFEM) plot $(JOINTS:cases/%.toml=reports/joints/%.json) --output reports/joints >/dev/null
	@for stage in mobility3 mobility6; do \
	    $(FLEXFEM) budget geometry/$$stage.toml --output reports && \
	    $(FLEXFEM) large geometry/$$stage.toml --output reports && \
	    $(FLEXFEM) converge geometry/$$stage.toml --output reports || exit 1; done
	@$(FLEXFEM) formulas --output reports
	@$(BIN)/python examples/claims.py --page reports/claims.md

studies: $(SETUP) ## run the shipped design studies and draw their figures, into reports/
	@for study in cases/study-*.toml; do \
	    $(FLEXFEM) study run $$study --output reports && $(FLEXFEM) study plot $$study --output reports || exit 1; done

designs: $(TEST_SETUP) ## run the worked designs, some minutes each, into reports/, and copy their figures into docs/
	@for file in cases/design-*.toml; do \
	    name=$$(basename $$file .toml); $(FLEXFEM) design $$file --output reports || exit 1; \
	    for figure in reports/$$name-design*.png; do \
	        cp $$figure docs/$$name$${figure#reports/$$name-design} || exit 1; done; done
	@$(BIN)/python -m tests.test_docs

test: $(TEST_SETUP) ## run all tests except the slow ones
	@$(BIN)/python -m pytest -n 2 -m "not slow"

test-slow: $(TEST_SETUP) ## run only the slow tests
	@failed=0; $(BIN)/python -m pytest -n 2 --dist loadgroup -m slow --ignore tests/study || failed=1; \
	    $(BIN)/python -m pytest -m slow tests/study || failed=1; exit $$failed # these start processes, and stop them by the clock

test-all: test test-slow ## run all tests

check: $(TEST_SETUP) ## run ruff and mypy
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

docs: $(DOCS_SETUP) ## build the documentation into build/docs and execute its examples
	@$(BIN)/python -m sphinx -W --keep-going -q -b html -d build/doctrees docs build/docs
	@echo "documentation: build/docs/index.html"

claims: $(SETUP) ## measure the paper's claims and other possible causes of its curves, into reports/claims.md (two minutes)
	@$(BIN)/python examples/claims.py --page reports/claims.md

validation: $(TEST_SETUP) ## compare with published problems and other solvers, into reports/verification-manual.md
	@$(BIN)/python -m tests.validation.manual

regression: $(SETUP) ## compare the computed numbers with the accepted ones in tests/baselines (two minutes)
	@$(FLEXFEM) regression tests/baselines

baselines: $(SETUP) ## accept the present numbers, with make baselines REASON="why"
	@$(FLEXFEM) baseline $(ACCEPTED) --baselines tests/baselines --reason "$(REASON)"

chart: $(SETUP) ## compute the hinge charts again by finite elements
	@$(BIN)/python benchmarks/hinge_charts.py

bench: $(TEST_SETUP) ## run the benchmarks, which measure ratios within one run
	@for script in benchmarks/*.py; do $(BIN)/python $$script || exit 1; done

clean: ## remove results, figures and caches, but not .venv
	rm -rf .pytest_cache .mypy_cache .ruff_cache .hypothesis build *.egg-info docs/gallery docs/jupyter_execute
	find reports -mindepth 1 ! -name README.md -delete
	find . -name __pycache__ -not -path './.venv/*' -prune -exec rm -rf {} +

$(SETUP): pyproject.toml
	@echo "installing flexfem and what it needs into .venv (a minute or two)"
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[fast]'
	@$(BIN)/python -c "from flexfem.meshing.session import require_gmsh; require_gmsh()"
	@touch $@

$(TEST_SETUP): $(SETUP)
	@echo "installing what the tests need"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[fast,test]'
	@touch $@

$(DOCS_SETUP): $(SETUP)
	@echo "installing what the documentation needs"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[fast,docs]'
	@touch $@
