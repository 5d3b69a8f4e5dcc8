# Every target sets up what it needs first; a second run sets nothing up again.
PYTHON3 ?= python3
BIN := .venv/bin
STUDY ?= reference -j 2
# Three workers for two cores: tests wait for deadlines and other processes. With two a sixth of the time was idle
# (1,150 s of wall clock, 1,930 s of CPU).
PYTEST := $(BIN)/python -m pytest -p no:anyio -n 3 --dist loadfile --no-loadscope-reorder -q --durations 30

# Tests start hundreds of processes: without stored bytecode each one compiles all it imports, half a second of CPU.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help setup demo test thorough episodes wheels check lock sbom licences pythons bench study ray learners docs films notebooks model detector browser readers eyes frameworks pictures missions selfcheck faults clean

help:
	@echo 'make demo    play the sea rescue, seed 5, broadcast, with the heuristic agents'
	@echo 'make test    run the tests'
	@echo 'make thorough  repeat checks of `make test` with more cases, processes and engines: minutes'
	@echo 'make episodes  play whole episodes of the shipped missions with the reference policies: minutes'
	@echo 'make wheels  install the wheels and their requirements from an index into a bare environment: minutes'
	@echo 'make check   ruff, mypy, import contracts and the tests'
	@echo 'make pythons  run the fast tests on Python 3.12 and 3.13, where they are found (TESTS=tests/dsl)'
	@echo 'make lock    write and verify requirements-lock.txt, the pinned packages with their hashes'
	@echo 'make sbom    write build/sbom.cdx.json, a bill of materials (make licences: the table in docs/supply-chain.md)'
	@echo 'make bench   compare with others, side by side'
	@echo 'make study   a suite: seeds 0-19, every mission in every mode, all reference agents: hours (STUDY="main --limit 1")'
	@echo 'make ray     install Ray, play suites on a cluster of two local nodes (three minutes)'
	@echo 'make learners  install Stable-Baselines3, RLlib, TorchRL and SuperSuit and train them for a few steps: minutes'
	@echo 'make docs    build the documentation site in build/site, check its links and run its examples: minutes (PAGES=docs/tutorials/from-carla.md)'
	@echo 'make films   play and film every mission in build/films, for the gallery of the site: minutes'
	@echo 'make notebooks  install what runs notebooks, and run those of examples/notebooks: minutes'
	@echo 'make model   install a small open model and play with it, offline: minutes'
	@echo 'make faults  plant 2,000 faults in episodes and suites, one at a time: an hour (FAULTS=200 SEED=7)'
	@echo 'make detector  play development seeds and train the detector of `learned` on their frames: an hour'
	@echo 'make browser  install a browser (Debian'"'"'s Chromium, playwright) and try the pages in it'
	@echo 'make readers  install what others read traces, results and cities with, and try it (needs Node.js)'
	@echo 'make eyes    install a detector trained on photographs and show it vehicles and people (needs Node.js; EYES=--quick)'
	@echo 'make frameworks  install LangGraph and Inspect beside, and try the examples of own agents with them: minutes'
	@echo 'make pictures  draw the contact sheet in docs/images'
	@echo 'make selfcheck  store the digest of the self-check anew, after a change of what engines compute'
	@echo 'make missions  play every mission and write its page in docs/missions (RESULTS=the folder of a suite)'

setup:
	@$(PYTHON3) tools/setup.py

demo:
	@$(PYTHON3) tools/setup.py --playing
	@$(BIN)/lingjing run scenarios/ssr.ljs --seed 5 --mode broadcast --policy heuristic

test: setup
	@$(PYTEST)

thorough: setup
	@$(PYTEST) -m thorough

episodes: setup
	@$(PYTEST) -m episodes tests/episodes

wheels: setup
	@$(BIN)/python -m pytest -q -p no:xdist -m wheels tests/packaging/test_wheels.py

check: setup
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports
	@$(BIN)/python tools/prose.py
	@$(BIN)/python tools/internals.py
	@$(PYTEST)

bench: setup
	@$(PYTHON3) tools/setup.py --bench
	@$(BIN)/python benchmarks/all.py

study: setup
	@$(BIN)/lingjing bench $(STUDY)

ray: setup
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --no-warn-conflicts -c constraints.txt ray
	@$(BIN)/python -m pytest -q -p no:xdist -m ray tests/bench/test_on_ray.py

detector: setup
	@mkdir -p build
	@$(BIN)/lingjing frames export --play ssr --mode star --set victims=6 --seeds 2000-2003 -j 2 -o build/frames-ssr
	@$(BIN)/lingjing frames export --play bi idf ufr --seeds 2000-2007 -j 2 -o build/frames
	@$(BIN)/python tools/train_detector.py build/frames-ssr --classes person_in_water
	@$(BIN)/python tools/train_detector.py build/frames --classes bridge_fracture building_fire fire_source

learners: setup
	@$(PYTHON3) tools/setup.py --learners
	@.venv-learners/bin/python -m pytest -q -m learners tests/envs/test_learners.py
	@.venv-learners/bin/python tools/page_examples.py docs/tutorials/train-a-policy.md docs/envs.md

docs: setup
	@$(PYTHON3) tools/setup.py --docs
	@.venv-docs/bin/cffconvert --validate -i CITATION.cff >/dev/null
	@$(BIN)/python tools/llms.py --check
	@NO_MKDOCS_2_WARNING=1 .venv-docs/bin/mkdocs build --quiet --strict
	@echo 'build/site/index.html is the documentation; now its examples are run'
	@$(BIN)/python tools/page_examples.py $(PAGES)

films: setup
	@mkdir -p build/films
	@for mission in $(notdir $(basename $(wildcard scenarios/*.ljs))); do \
		test -s build/films/$$mission.mp4 && continue; rm -rf build/films/$$mission; \
		$(BIN)/lingjing run $$mission --seed 1 --policy oracle --no-overview -o build/films/$$mission >/dev/null && \
		$(BIN)/lingjing film build/films/$$mission/trace.mcap -o build/films/$$mission.mp4 || exit 1; \
	done

notebooks: setup
	@$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt nbclient nbformat ipykernel pandas
	@$(BIN)/python -m pytest -q -p no:xdist tests/play/test_notebooks.py

faults: setup
	@FAULTS=$(or $(FAULTS),2000) SEED=$(or $(SEED),1) $(BIN)/python -m pytest -q -s -p no:xdist -m faults --timeout 36000 tests/faults

selfcheck: setup
	@$(BIN)/python -m lingjing.play.selfcheck

model: setup
	@$(PYTHON3) tools/setup.py --model
	@LINGJING_MODEL_PYTHON=$(CURDIR)/.venv-model/bin/python $(BIN)/python -m pytest -m model -q -s -p no:xdist agents/tests

browser: setup
	@command -v chromium >/dev/null || { apt-get update -q >/dev/null && apt-get install -y -q --no-install-recommends chromium >/dev/null; }
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --no-warn-conflicts -c constraints.txt playwright
	@$(BIN)/python -m pytest -q -p no:xdist tests/viewer/test_in_browser.py

readers: setup
	@npm install --prefix tests/readers --no-audit --no-fund --no-package-lock --ignore-scripts --loglevel=error
	@$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt rerun-sdk websockets pandas polars mlcroissant pyogrio pyproj tensorboard mlflow-skinny
	@$(BIN)/python -m pytest -q -p no:xdist tests/trace/test_trace_in_node.py tests/viewer/test_rerun_recording.py tests/viewer/test_foxglove_server.py tests/trace/test_trace_tables.py tests/play/test_public_examples.py tests/bench/test_croissant.py tests/cli/test_cli_exports.py
	@$(BIN)/python tools/page_examples.py docs/python.md

eyes: setup
	@npm install --prefix benchmarks/eyes_net --no-audit --no-fund --no-package-lock --ignore-scripts --legacy-peer-deps --loglevel=error
	@test -d build/eyes/metadrive || $(PYTHON3) -m pip install -qq --disable-pip-version-check --no-deps --target build/eyes metadrive-simulator==0.3.0.1
	@$(BIN)/python benchmarks/eyes.py $(EYES)

frameworks: setup
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --target build/frameworks inspect_ai==0.3.285 langgraph langchain-openai
	@PYTHONPATH=build/frameworks $(BIN)/python -m pytest -q -p no:xdist agents/tests/test_own_agents.py tests/bench/test_inspect_task.py

pictures: setup
	@$(BIN)/python tools/contact_sheet.py

lock: setup
	@$(BIN)/python tools/supply_chain.py lock
	@$(BIN)/python tools/supply_chain.py verify
	@$(BIN)/python tools/supply_chain.py check

sbom: setup
	@$(BIN)/python tools/supply_chain.py sbom

licences: setup
	@$(BIN)/python tools/supply_chain.py licences

pythons:
	@$(PYTHON3) tools/pythons.py $(TESTS)

missions: setup
	@$(BIN)/python tools/mission_pages.py --again $(if $(RESULTS),--results $(RESULTS))

clean:
	rm -rf build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache
