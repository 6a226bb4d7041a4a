# Everything here runs in .venv, which the first call makes. All that a machine needs
# beforehand is Python 3.11 with pip and venv.

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install compare bench bench-peers peers-mushroom peers-pets peers-swarms peers-mpe2 test lint format build check-wheel docs docs-serve clean distclean

VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
SITE := docs/_build/html
WHEEL_VENV := build/wheel-venv
PEERS_VENV := .venv-peers
PEERS_STAMP := $(PEERS_VENV)/.installed
MUSHROOM_VENV := .venv-mushroom
MUSHROOM_STAMP := $(MUSHROOM_VENV)/.installed
PETS_VENV := .venv-pets
PETS_STAMP := $(PETS_VENV)/.installed
SWARMS_VENV := .venv-swarms
SWARMS_STAMP := $(SWARMS_VENV)/.installed
MPE2_VENV := .venv-mpe2
MPE2_STAMP := $(MPE2_VENV)/.installed

# The first interpreter that works, is recent enough and can make an environment.
PYTHON ?= $(shell for python in python3.11 python3; do \
	$$python -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' \
	2>/dev/null && echo $$python && break; done)

PIP_INSTALL := -m pip install -qq --disable-pip-version-check

PRESET ?= quick
ENV_ID ?= acl_gym/Pendulum-v0
OUT ?=
PORT ?= 8000
REPORT ?=
WORKERS ?= 2

help: ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' \
		$(firstword $(MAKEFILE_LIST))
	@echo
	@echo "  Variables: ARGS (added to the command of compare, bench and test),"
	@echo "  ENV_ID, PRESET and OUT (compare), WORKERS (test), PORT (docs-serve),"
	@echo "  REPORT (docs: a folder of acl-gym reproduce), PYTHON (makes .venv)."

# pip runs again only when one of these two files has changed.
install: $(STAMP) ## Make .venv with the locked dependencies and this package

$(STAMP): requirements.lock pyproject.toml
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || { \
		test -n "$(PYTHON)" || { echo >&2 "make: found no Python 3.11 or later" \
			"that has pip and venv; install one or name it: make PYTHON=..."; \
			exit 1; }; \
		echo "Making $(VENV) with $(PYTHON)"; \
		$(PYTHON) -m venv --clear $(VENV); }
	@echo "Installing the locked dependencies into $(VENV): a few minutes, once"
	@$(BIN)/python $(PIP_INSTALL) -r requirements.lock
	@$(BIN)/python $(PIP_INSTALL) --no-deps --no-build-isolation -e .
	@$(BIN)/python -m pip check --disable-pip-version-check
	@touch $@

compare: $(STAMP) ## Compare both colonies, Q-learning, DQN, PPO and A2C on one task
	$(BIN)/python benchmarks/compare_acl_rl.py --env $(ENV_ID) --preset $(PRESET) \
		$(if $(OUT),--out $(OUT)) $(ARGS)

bench: $(STAMP) ## Measure the speed of environments and colonies
	$(BIN)/python benchmarks/throughput.py $(ARGS)

bench-peers: $(STAMP) $(PEERS_STAMP) ## The same, with EnvPool and gymnax
	$(BIN)/python benchmarks/throughput.py $(ARGS)

$(PEERS_STAMP): benchmarks/peers-requirements.txt
	@rm -rf $(PEERS_VENV)
	@$(BIN)/python -m venv $(PEERS_VENV)
	@echo "Installing EnvPool and gymnax into $(PEERS_VENV): a few minutes, once"
	@$(PEERS_VENV)/bin/python $(PIP_INSTALL) -r benchmarks/peers-requirements.txt
	@touch $@

peers-mushroom: $(STAMP) $(MUSHROOM_STAMP) ## Learn with MushroomRL's Sarsa(lambda)
	$(MUSHROOM_VENV)/bin/python benchmarks/tile_coding.py $(ARGS)

$(MUSHROOM_STAMP): requirements.lock benchmarks/mushroom-requirements.txt
	@rm -rf $(MUSHROOM_VENV)
	@$(BIN)/python -m venv $(MUSHROOM_VENV)
	@echo "Installing MushroomRL into $(MUSHROOM_VENV): a few minutes, once"
	@$(MUSHROOM_VENV)/bin/python $(PIP_INSTALL) -r requirements.lock
	@$(MUSHROOM_VENV)/bin/python $(PIP_INSTALL) --no-deps \
		-r benchmarks/mushroom-requirements.txt
	@$(MUSHROOM_VENV)/bin/python $(PIP_INSTALL) --no-deps --no-build-isolation -e .
	@touch $@

peers-pets: $(STAMP) $(PETS_STAMP) ## Learn from few interactions with mbrl-lib's PETS
	$(PETS_VENV)/bin/python benchmarks/few_interactions.py --methods pets $(ARGS)

$(PETS_STAMP): requirements.lock benchmarks/pets-requirements.txt
	@rm -rf $(PETS_VENV)
	@$(BIN)/python -m venv $(PETS_VENV)
	@echo "Installing mbrl-lib into $(PETS_VENV): a few minutes, once"
	@$(PETS_VENV)/bin/python $(PIP_INSTALL) -r requirements.lock
	@$(PETS_VENV)/bin/python $(PIP_INSTALL) --no-deps \
		-r benchmarks/pets-requirements.txt
	@$(PETS_VENV)/bin/python $(PIP_INSTALL) --no-deps --no-build-isolation -e .
	@touch $@

peers-swarms: $(STAMP) $(SWARMS_STAMP) ## Minimize with particle swarms of pyswarms and pygmo
	PYTHONPATH=. $(SWARMS_VENV)/bin/python benchmarks/particle_swarms.py $(ARGS)

$(SWARMS_STAMP): benchmarks/swarms-requirements.txt
	@rm -rf $(SWARMS_VENV)
	@$(BIN)/python -m venv $(SWARMS_VENV)
	@echo "Installing pyswarms and pygmo into $(SWARMS_VENV): a minute, once"
	@$(SWARMS_VENV)/bin/python $(PIP_INSTALL) -r benchmarks/swarms-requirements.txt
	@touch $@

peers-mpe2: $(STAMP) $(MPE2_STAMP) ## Measure swarms beside mpe2's simple_spread
	$(BIN)/python benchmarks/swarm_aggregation.py $(ARGS)

$(MPE2_STAMP): benchmarks/mpe2-requirements.txt
	@rm -rf $(MPE2_VENV)
	@$(BIN)/python -m venv $(MPE2_VENV)
	@echo "Installing mpe2 into $(MPE2_VENV): a minute, once"
	@$(MPE2_VENV)/bin/python $(PIP_INSTALL) -r benchmarks/mpe2-requirements.txt
	@touch $@

test: $(STAMP) ## Run every test
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(ARGS)

lint: $(STAMP) ## Check style, format, types and the layers of imports
	$(BIN)/python -m ruff check .
	$(BIN)/python -m ruff format --check .
	$(BIN)/python -m mypy
	$(BIN)/lint-imports --no-cache --no-logo

format: $(STAMP) ## Repair style and format
	$(BIN)/python -m ruff check --fix-only .
	$(BIN)/python -m ruff format .

docs: $(STAMP) ## Build the documentation site into docs/_build/html
	$(BIN)/python -m sphinx -b html -W --keep-going -q $(ARGS) \
		docs $(SITE)
	$(if $(REPORT),$(call add_report,$(SITE)/reproduction/report))
	@echo "The site is in $(SITE)/index.html"

# The page of `acl-gym reproduce`, and what it loads.
define add_report
	@mkdir -p $(1)/figures
	@cp -r $(REPORT)/report.html $(REPORT)/curves $(1)
	@cp $(wildcard $(REPORT)/figures/*.png $(REPORT)/figures/*.gif) $(1)/figures
	@echo "The report of the reproduction is in $(1)/report.html"
endef

docs-serve: docs ## Serve the site on http://localhost:$(PORT)
	$(BIN)/python -m http.server --bind localhost --directory $(SITE) $(PORT)

build: $(STAMP) ## Build the sdist, and from it the wheel, into dist/
	@rm -rf dist
	$(BIN)/python -m build --no-isolation

check-wheel: build ## Check sdist and wheel, and try the wheel in an empty environment
	$(BIN)/python -m twine check --strict dist/*
	$(BIN)/check-wheel-contents dist
	$(BIN)/python .ci/check_sdist.py dist
	@rm -rf $(WHEEL_VENV)
	@$(BIN)/python -m venv $(WHEEL_VENV)
	@echo "Installing the wheel and its dependencies into $(WHEEL_VENV)"
	@$(WHEEL_VENV)/bin/python $(PIP_INSTALL) -c requirements.lock dist/acl_gym-*.whl
	cd $(WHEEL_VENV) && bin/python -c "import acl_gym"
	$(WHEEL_VENV)/bin/python -I .ci/check_wheel.py
	@rm -rf $(WHEEL_VENV)

clean: ## Remove builds and caches, including compiled kernels
	rm -rf build dist docs/_build docs/environments/generated .grimp_cache .hypothesis .mypy_cache .numba_cache .pytest_cache .ruff_cache
	find . -name '$(VENV)*' -prune -o -name __pycache__ -type d -prune \
		-exec rm -rf {} +

distclean: clean ## Remove .venv as well
	rm -rf $(VENV) $(PEERS_VENV) $(MUSHROOM_VENV) $(PETS_VENV) $(SWARMS_VENV) $(MPE2_VENV)
