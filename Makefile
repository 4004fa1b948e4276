# `make demo` and `make test` set everything up; the rest works on top of that.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
MODE := exact
APART := tests/faults tests/benchmarks tests/cache tests/datasets tests/stages tests/system/test_silence.py
OF_MODE := $(if $(filter guided,$(MODE)),.guided)
ifeq ($(filter exact guided,$(MODE)),)
$(error MODE=$(MODE): the weights that come with the package are of exact and of guided volumes)
endif

.PHONY: demo test names lint docs commands pictures train descriptors evaluation evidence foreign calibration train-general bench faults silence wheel clean

demo: $(READY)  ## run the pipeline on the bundled Motorcycle pair
	$(BIN)/pipeline run motorcycle --output demo

test: $(READY)  ## run the tests, in two processes side by side
	printf '%s\n' '$(APART)' 'tests $(APART:%=--ignore=%)' | xargs -P 2 -L 1 $(BIN)/python -m pytest

names: $(READY)  # what reads the sources does not follow the import hook of an editable install
	mkdir -p build/names/semidense
	for folder in pipeline stages datasets cache; do ln -sfn ../../../$$folder build/names/semidense/$$folder; done

lint: names  ## style, types, and who may import whom
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: names  ## build the documentation site into build/site; a link that leads nowhere is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

commands: $(READY)  ## run every command that the documents show and that needs no data of the reader
	$(BIN)/python -m tests.system.commands

pictures: $(READY)  ## DATA=DIR (optional): make the pictures of the documents again; with DATA also that of other matchers
	$(BIN)/python -m tests.system.pictures $(if $(DATA),middlebury:$(DATA)/MiddEval3/trainingQ)

train: $(READY)  ## DATA=DIR: train both networks on DIR/2001, 2003, 2005 and 2006, and put the weights in place
	@test -n "$(DATA)" || { echo "make train: say where the Middlebury sets are: make train DATA=DIR"; exit 2; }
	$(BIN)/pipeline run middlebury:$(DATA) --train --upto evaluation_net --output build/weights
	cp build/weights/*.safetensors stages/weights/

descriptors: $(READY)  ## DATA=DIR: train the network of guided and fast volumes on the same scenes, and put its weights in place
	@test -n "$(DATA)" || { echo "make descriptors: say where the Middlebury sets are: make descriptors DATA=DIR"; exit 2; }
	$(BIN)/pipeline run middlebury:$(DATA) --train --upto descriptor_net --output build/weights
	cp build/weights/descriptor_net.safetensors stages/weights/

evaluation: $(READY)  ## DATA=DIR MODE=guided: train the evaluation-Net of such volumes, and put its weights in place
	@test -n "$(DATA)" || { echo "make evaluation: say where the Middlebury sets are: make evaluation DATA=DIR"; exit 2; }
	$(BIN)/pipeline run middlebury:$(DATA) --train --upto evaluation_net --set costvolume.mode=$(MODE) \
		--set 'training.shipped=["matching_net", "descriptor_net"]' --output build/$(MODE)
	cp build/$(MODE)/evaluation_net.safetensors stages/weights/evaluation_net$(OF_MODE).safetensors

evidence: $(READY)  ## DATA=DIR: train what weighs the evidence of indoor aggregated maps, and put its weights in place
	@test -n "$(DATA)" || { echo "make evidence: say where the Middlebury sets are: make evidence DATA=DIR"; exit 2; }
	$(BIN)/pipeline run middlebury:$(DATA) --preset robust --train --upto evidence_net --output build/robust \
		--set training.weights=indoor --set training.cross_fit=false --set channels.align=false \
		--set 'training.shipped=["matching_net", "descriptor_net", "evaluation_net"]'
	cp build/robust/evidence_net.safetensors stages/weights/

train-general: $(READY)  ## DATA=DIR: train the preset robust on DIR/middlebury and DIR/kitti2012, and put its weights in place
	@test -n "$(DATA)" || { echo "make train-general: say where the data is: make train-general DATA=DIR"; exit 2; }
	for product in descriptor_net evidence_net evaluation_net; do \
		$(BIN)/pipeline run middlebury:$(DATA)/middlebury+kitti2012:$(DATA)/kitti2012 --preset robust --train \
			--upto $$product --output build/general/$$product || exit; \
	done
	for px in 1 2 3; do \
		$(BIN)/pipeline run middlebury:$(DATA)/middlebury+kitti2012:$(DATA)/kitti2012 --preset robust --train \
			--upto calibration --set calibration.tolerance=$$px --output build/general/$$px || exit; \
	done
	for net in descriptor_net evidence_net evaluation_net; do \
		cp build/general/$$net/$$net.safetensors stages/weights/general/$$net.safetensors; \
	done
	cp build/general/1/calibration.safetensors \
		stages/weights/general/calibration.evidence_confidence.aggregated.fast.safetensors
	for px in 2 3; do \
		cp build/general/$$px/calibration.safetensors \
			stages/weights/general/calibration.evidence_confidence.aggregated.fast.$${px}px.safetensors; \
	done

foreign: $(READY)  ## DATA=DIR: train what scores maps of other matchers, and put its weights in place
	@test -n "$(DATA)" || { echo "make foreign: say where the Middlebury sets are: make foreign DATA=DIR"; exit 2; }
	$(BIN)/pipeline run middlebury:$(DATA) --train --upto foreign_net --set costvolume.mode=fast --output build/foreign \
		--set 'training.shipped=["matching_net", "descriptor_net", "evaluation_net"]'
	cp build/foreign/foreign_net.safetensors stages/weights/

calibration: $(READY)  ## DATA=DIR MODE=guided: measure on the same scenes what its confidence is worth, put the table in place
	@test -n "$(DATA)" || { echo "make calibration: say where the Middlebury sets are: make calibration DATA=DIR"; exit 2; }
	$(BIN)/pipeline run middlebury:$(DATA) --train --upto calibration --set costvolume.mode=$(MODE) --output build/$(MODE)
	cp build/$(MODE)/calibration.safetensors stages/weights/calibration$(OF_MODE).safetensors

bench: $(READY)  ## DATA=DIR (optional): every benchmark of speed, bfloat16 against float32, what guarding costs, a time line
	$(BIN)/python -m benchmarks
	$(BIN)/python -m benchmarks.precision --rows 12 $(if $(DATA),middlebury:$(DATA)/MiddEval3/trainingQ,motorcycle)
	$(BIN)/python -m benchmarks.guarding
	$(BIN)/python -m benchmarks.timeline

faults: $(READY)  ## inject every fault of the matrix, and put the outcome where README.md and docs/cache.md quote it
	$(BIN)/python -m tests.faults --json docs/faults.json --quote

silence: $(READY)  ## paint 200 regions without information into a real pair: at most 1 % of each may be kept
	SILENCE_DRAWS=200 $(BIN)/python -m pytest tests/system/test_silence.py

wheel: $(READY)  ## build the wheel and the source distribution, and check both
	rm -rf dist
	$(BIN)/python -m build --no-isolation --outdir dist .
	$(BIN)/twine check --strict dist/*
	$(BIN)/check-wheel-contents dist/*.whl

clean:
	rm -rf .venv build dist demo *.egg-info

$(READY): pyproject.toml setup.py constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev,docs]'
	@touch $@
