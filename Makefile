# `make demo` shows the main job; `make test` runs the tests. Each builds its own environment.
PYTHON ?= python3
VENV := .venv/bin

.PHONY: demo test lint environment
demo: environment
	$(VENV)/wind demo --force

test: environment
	$(VENV)/python -m pytest -n 2 --dist loadfile

lint: environment
	$(PYTHON) scripts/bootstrap.py test dev
	$(VENV)/ruff check .
	$(VENV)/mypy

environment:
	@$(PYTHON) scripts/bootstrap.py test
