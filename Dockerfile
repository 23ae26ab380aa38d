# Builds with BuildKit (the cache mounts need it):
# docker build --build-arg OFFBD_COMMIT=$(git rev-parse --short=12 HEAD) -t offbd .
# Runs: docker run -p 127.0.0.1:8087:8087 -v offbd:/var/lib/offbd offbd
# The service requires a token; make the first one with
# docker run --rm -v offbd:/var/lib/offbd offbd token create --name ann --role admin

FROM rust:1-bookworm AS build
# Node builds the dashboard; it is not needed at run time.
RUN apt-get update && apt-get install -y --no-install-recommends nodejs npm \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY Cargo.toml Cargo.lock build.rs ./
COPY crates crates
COPY migrations migrations
COPY benches benches
COPY examples examples
COPY src src
COPY tests tests
COPY docs/charts docs/charts
COPY web web
# Benchmarks, examples and tests are copied because Cargo.toml names them. The build
# leaves out the laboratory (scenes, charts, simulated rigs) and includes OpenTelemetry, NATS,
# MQTT, e-mail, MCAP, Parquet and Excel.
# `offbd --version` prints the commit, which the build cannot ask git for here.
ARG OFFBD_COMMIT
# Cache mounts keep packages and compiled dependencies from build to build; the
# program is copied out of them, because a mount is not part of the image.
RUN --mount=type=cache,target=/usr/local/cargo/registry \
    --mount=type=cache,target=/src/target \
    cargo build --profile dist --no-default-features --features email,mcap,mqtt,nats,otel,parquet,xlsx --locked --package offbd --bin offbd \
    && cp target/dist/offbd /usr/local/bin/offbd

FROM debian:bookworm-slim
# The authorities that sign the certificates of webhooks, mail servers, brokers and of the
# provider of JSON Web Tokens.
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates \
    && rm -rf /var/lib/apt/lists/*
RUN useradd --system --uid 10001 --home-dir /var/lib/offbd --create-home offbd
COPY --from=build /usr/local/bin/offbd /usr/local/bin/offbd
USER offbd
WORKDIR /var/lib/offbd
VOLUME /var/lib/offbd
ENV OFFBD_LISTEN=0.0.0.0:8087 \
    OFFBD_DATA=/var/lib/offbd \
    OFFBD_LOG__FORMAT=json
EXPOSE 8087
# Asks the service where the environment says that it listens, with TLS or without. Settings that
# you give `serve` as arguments are to be given here too.
HEALTHCHECK --interval=10s --timeout=5s --start-period=10s CMD ["offbd", "check", "--health"]
# `docker stop` sends SIGTERM, on which the service stops gracefully.
ENTRYPOINT ["offbd"]
CMD ["serve"]
