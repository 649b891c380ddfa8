# One image per service: docker build --build-arg SERVICE=recon -t medor-recon .
ARG PYTHON_IMAGE=python:3.11-slim-bookworm

FROM ${PYTHON_IMAGE} AS build
ARG SERVICE
# Packages of ours the service stands on.
ARG SHARED="./shared/wire ./shared/cloth"
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /src
RUN python -m venv /opt/venv
COPY constraints.txt .
COPY shared/ shared/
COPY services/${SERVICE}/ services/${SERVICE}/
# One call, so that our packages find each other instead of being looked for on an index.
RUN /opt/venv/bin/python -m pip install -c constraints.txt ${SHARED} ./services/${SERVICE}

FROM ${PYTHON_IMAGE} AS runtime
ARG SERVICE
# System libraries the service's wheels do not bring along.
ARG SYSTEM_PACKAGES=""
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
# hadolint ignore=DL3008
RUN if [ -n "${SYSTEM_PACKAGES}" ]; then \
        apt-get update && \
        tr ' ' '\n' <<< "${SYSTEM_PACKAGES}" | xargs apt-get install -y --no-install-recommends && \
        rm -rf /var/lib/apt/lists/*; \
    fi
RUN useradd --uid 10001 --no-create-home medor && install -d -o 10001 /medor /medor/runs
COPY --from=build /opt/venv /opt/venv
# Compiled kernels are kept in the volume: a restarted container is warm.
ENV PATH=/opt/venv/bin:$PATH PYTHONUNBUFFERED=1 NUMBA_CACHE_DIR=/medor/runs/numba SERVICE=${SERVICE}
WORKDIR /medor
USER 10001
HEALTHCHECK --interval=5s --timeout=5s --start-period=60s CMD ["python", "-m", "medor_wire.health"]
CMD ["sh", "-c", "exec python -m medor_${SERVICE}.serve"]
