# What there is to do; `just` alone lists it.

_list:
    @just --list

# Everything that must hold before a change goes in
test:
    scripts/test

# Quick: compile and lint
check:
    cargo clippy --all-targets -- -D warnings

# The floors, and the paths that the documents name
rules:
    cargo test --test it architecture

# A minute of a simulated rig with faults, against the real service
demo:
    cargo run --release -- demo --seconds 60

# The service on the embedded store
serve *ARGS:
    cargo run --release -- serve {{ARGS}}

# openapi.yaml as the code has it
openapi:
    UPDATE_OPENAPI=1 cargo test --test it openapi

# The output that README.md shows, anew
tour:
    cargo build --release
    scripts/tour --update

# The dashboard while it is worked on: shows changes at once, beside `just serve`
web:
    cd web && npm ci && npx vite

# The dashboard in a real browser
browser:
    cargo build --bin offbd
    npm --prefix web test

# The dashboard's pictures in README.md, anew
screenshots:
    scripts/screenshots --docs

# The picture in README.md, anew
picture:
    cargo build --release
    scripts/picture

# How fast samples go through
bench:
    cargo bench --bench ingest
    cargo bench -p offbd-lab --bench batch

# Other people's engines and solvers on the scenes of `offbd chart work-precision`
peers *ARGS:
    benches/peers/run {{ARGS}}
