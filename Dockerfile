# MineXplore in a bare Debian. `make setup` installs everything but make itself.
#   docker build -t minexplore . && docker run --rm -it minexplore make all
FROM debian:bookworm-slim

# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends make \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /minexplore
COPY Makefile ./
COPY requirements requirements
RUN make setup

COPY . .
CMD ["make", "help"]
