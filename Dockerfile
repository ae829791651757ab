# GelLight in a container, without root: `docker build -t gellight .`, then
# `docker run --rm -p 8420:8420 gellight` for the demo, or with a sensor
# `docker run --rm --network host --device /dev/video0 --device /dev/ttyACM0 --group-add video --group-add dialout gellight run`.
FROM python:3.13-slim AS built
WORKDIR /src
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY host host
COPY models models
COPY sim_reference sim_reference
RUN python -m venv /opt/gellight \
    && /opt/gellight/bin/pip install --no-cache-dir --require-hashes -r host/requirements.txt \
    && /opt/gellight/bin/pip install --no-cache-dir --no-deps . ./host/gellight_ros

FROM python:3.13-slim
# hadolint ignore=DL3008
RUN apt-get update && apt-get install --no-install-recommends -y libusb-1.0-0 && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 gellight
COPY --from=built /opt/gellight /opt/gellight
ENV PATH=/opt/gellight/bin:$PATH
USER 1000
WORKDIR /home/gellight
EXPOSE 8420
ENTRYPOINT ["gellight"]
CMD ["demo", "--no-browser", "--set", "dashboard.host=0.0.0.0"]
