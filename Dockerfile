# Built by: docker build -t stseg .
# Run with: docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" stseg run room.toml -o room.h5
FROM python:3.12-slim AS build
COPY . /source
RUN apt-get update && apt-get install -y --no-install-recommends g++ && \
    python -m venv /opt/stseg && /opt/stseg/bin/pip install --no-cache-dir /source

FROM python:3.12-slim
COPY --from=build /opt/stseg /opt/stseg
RUN useradd --create-home --uid 1000 stseg && mkdir /data && chown stseg /data
USER stseg
WORKDIR /data
ENV PATH=/opt/stseg/bin:$PATH NUMBA_CACHE_DIR=/home/stseg/.cache/numba
ENTRYPOINT ["stseg"]
CMD ["--help"]
