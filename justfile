# Shortcuts; `just` without arguments lists them.

_list:
    @just --list

# All checks that a change must pass
test:
    scripts/test

# Compile and lint
check:
    cargo clippy --all-targets -- -D warnings

# The architecture rules, and the paths that the documents name
rules:
    cargo test --test it architecture

# A minute of a simulated rig with faults, against the real service
demo:
    cargo run -- demo --seconds 60

# The service on the embedded store
serve *ARGS:
    cargo run --release -- serve {{ARGS}}

# Regenerate openapi.yaml from the code
openapi:
    UPDATE_OPENAPI=1 cargo test --package offbd-http --test description

# Update the command output in the pages of the tour
tour:
    cargo build --release
    scripts/tour --update

# Development server of the dashboard, for use with `just serve`
web:
    cd web && npm ci && npx vite

# Test the dashboard in a browser
browser:
    cargo build --bin offbd
    npm --prefix web test

# Update the dashboard's pictures in the documents
screenshots:
    scripts/screenshots --docs

# Update the first picture in README.md
picture:
    cargo build --release
    scripts/picture

# Benchmarks of ingest
bench:
    cargo bench --bench ingest

# Benchmark other engines and solvers on the scenes of `offbd chart work-precision`
peers *ARGS:
    benches/peers/run {{ARGS}}
