# camssf batch in a container; docs/install.md says how to run it.
FROM python:3.13-slim AS build
WORKDIR /src
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY reference reference
COPY export export
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.13-slim
COPY constraints.txt /tmp/constraints.txt
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir --constraint /tmp/constraints.txt "$(echo /wheels/*.whl)[fleet,passport]" \
    && useradd --create-home --uid 1000 camssf \
    && mkdir /data \
    && chown 1000 /data
USER 1000
WORKDIR /data
ENTRYPOINT ["camssf"]
CMD ["--help"]
