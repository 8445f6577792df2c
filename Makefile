# `make run` opens the window (or, without a display, replays the default scene into out/).
# `make test` runs everything that CI runs.

CARGO ?= cargo
export XDG_RUNTIME_DIR ?= /tmp

.PHONY: run test setup bench gallery

run: setup
	$(CARGO) build --release
	./target/release/palpate

test: setup
	$(CARGO) fmt --check
	$(CARGO) clippy --all-targets -- -D warnings
	$(CARGO) test
	$(CARGO) run --quiet -- replay liver --frames 20 --size 320x240 --out out/ci-liver
	$(CARGO) run --quiet -- replay liver-gooey --frames 20 --size 320x240 --out out/ci-gooey

bench: setup
	$(CARGO) bench

# Draws docs/GALLERY.md and its pictures anew, and records what each technique changes.
gallery: setup
	PALPATE_ACCEPT=1 $(CARGO) test --test gallery

setup:
	@sh tests/setup.sh
