# Two commands matter: `make demo` and `make test`. Each does all set-up first, and skips it when nothing changed.

# The first Python that runs and is new enough; set PYTHON to choose another.
PYTHON := $(or $(PYTHON),$(shell for python in python3.11 python3 python3.12 python3.13; do \
  $$python -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$python && break; done))
STAMP := .venv/requirements.txt
export PATH := $(CURDIR)/.venv/bin:$(PATH)

.PHONY: demo test gate lock readme setup clean

demo: setup          ## run the whole pipeline, from recording the demo logs to the Unity package
	python -m trunkline.pipeline.settings
	dvc repro
	@ls -lh artifacts/package_unity/*.tgz

test: setup          ## run every test, then lint
	python -m pytest -n auto --dist loadgroup
	ruff check --output-format concise .

gate: setup          ## compare the metrics with tests/limits.yaml
	python -m trunkline.pipeline.gate

lock: setup          ## check that dvc.lock belongs to the code, params.yaml and the metrics
	python -m trunkline.pipeline.lock

readme: setup        ## regenerate the README's graph, table and picture
	python -m trunkline.pipeline.readme

setup: $(STAMP)

# The stamp is a copy of requirements.txt, made last: an interrupted set-up starts again. The .pth file puts this
# folder on the path of the virtual environment's Python, as an editable install would.
$(STAMP): requirements.txt
	@test -n "$(PYTHON)" || { echo "error: found no Python 3.11 or newer" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { apt-get update -qq && apt-get install -qq -y python3-venv; } || \
	  { echo "error: Python has no venv module; install Debian's python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv --clear .venv
	@echo "installing the packages of requirements.txt into .venv (some minutes, once)"
	@.venv/bin/python -m pip install -qq --no-compile --disable-pip-version-check -r requirements.txt
	@.venv/bin/python -c 'import pathlib, sysconfig; \
	  pathlib.Path(sysconfig.get_path("purelib"), "trunkline.pth").write_text(str(pathlib.Path.cwd()) + "\n")'
	@cp requirements.txt $(STAMP)

clean:               ## remove the virtual environment
	rm -rf .venv
