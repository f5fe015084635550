# Image with the program alone, for CI, Kubernetes and Apptainer: docker build -t brakecheck .
ARG RUST=1.95
FROM rust:${RUST}-slim-bookworm AS build
WORKDIR /src
COPY . .
RUN cargo build --locked --profile dist -p brakecheck --bin brakecheck

FROM debian:bookworm-slim
COPY --from=build /src/target/dist/brakecheck /usr/local/bin/brakecheck
COPY LICENSE THIRD_PARTY.txt /usr/share/doc/brakecheck/
RUN useradd --uid 1000 --create-home brakecheck && install -d -o brakecheck /work
USER 1000
WORKDIR /work
# No entry point, because CI and Apptainer start a shell.
CMD ["brakecheck", "--help"]
